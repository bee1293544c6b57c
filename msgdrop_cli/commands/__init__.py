"""The commands, one file each: parse, call, show. `console` is the only module that prints."""
