"""Games of other people: any PettingZoo `ParallelEnv`, named by the factory that makes one."""
