"""What the pursuers of waterworld see: the nearest ally, food and poison on each of their sensors.

A sensor is a ray from the pursuer's centre. It meets an object whose centre is at most a radius to
its side, and between 0 and `sensor_range` along it. Of each class it reads the one that is nearest
along it: the distance along it, and the velocity along it relative to the pursuer's own. Where it
meets nothing it reads 0 and 0.

Of the pairs of pursuer and object few are near each other, and of the sensors of a near pair few
meet: each is sought among the former, with no loop and no [pursuers, objects, sensors] tensor.
A GPU, which would have to tell the host how many there are, looks at all of them instead.
"""

import math

import torch
from torch import Tensor

from msgdrop_envs import waiting
from msgdrop_envs.waterworld.config import Config
from msgdrop_envs.waterworld.planes import dot

CLASSES = 3
"""Allies, food, poison."""
UNMET = torch.iinfo(torch.int64).max


class Sensors:
    """The sensors of all pursuers of any number of games; holds tables only."""

    def __init__(self, config: Config, device: torch.device) -> None:
        self.config = config
        rays, agents = config.sensors, config.pursuers
        self.size = 2 + 2 * CLASSES * rays + rays * config.senses_obstacle + 2 * config.senses_touch
        # Reckoned on the processor, wherever they are needed: `meta` is asked for shapes only.
        angles = torch.arange(rays, dtype=torch.float64, device="cpu") * (2 * math.pi / rays)
        # Rounded, so that a quarter turn has the cosine 0 and not 6e-17.
        cos = angles.cos().round(decimals=12).float()
        sin = angles.sin().round(decimals=12).float()
        self._cos, self._sin = cos.to(device), sin.to(device)
        # What a place or velocity is multiplied by to be along a ray, or across it: [2, 1, S].
        self._along = torch.stack((cos, sin))[:, None].to(device)
        self._across = torch.stack((sin, -cos))[:, None].to(device)
        self._numbers = numbers = (agents, config.food, config.poison)
        kinds = [kind for kind, number in enumerate(numbers) for _ in range(number)]
        by_kind = config.radii if config.sensor_width == "object" else (config.radius,) * CLASSES
        widths = torch.tensor([by_kind[kind] for kind in kinds], device="cpu")
        self._widths = widths[:, None].to(device)  # [N+M+L, 1]
        # A little more than is needed: what each sensor meets is decided exactly later on.
        near = ((config.sensor_range**2 + widths**2) * 1.001).repeat(agents, 1)  # [N, N+M+L]
        near[:, :agents].fill_diagonal_(-1.0)  # nobody senses itself
        self._near = near[..., None].to(device)
        # Where in its game's observations an agent's first reading of an object's kind stands.
        firsts = torch.arange(agents, device="cpu")[:, None] * self.size
        columns = firsts + 2 + torch.tensor(kinds, device="cpu") * (2 * rays)
        self._columns = columns.to(device)  # [N, N+M+L]

    def read(self, positions: Tensor, velocities: Tensor, touch: Tensor) -> Tensor:
        """What all pursuers see, [B, N, O] float32.

        positions, velocities: [2, N+M+L, B]; touch: [N, M+L, B] bool, who touches what.
        Position (x, y); then for allies, food and poison in turn all distances and all velocities.
        """
        config, games = self.config, positions.shape[-1]
        obs = positions.new_zeros(games, config.pursuers, self.size)
        own = positions[:, : config.pursuers].permute(2, 1, 0)  # [B, N, 2]
        obs[..., :2] = own * 2 - 1 if config.sensors_scaled else own
        sense = self._sense if waiting.can_ask(positions) else self._sense_all
        sense(obs, positions, velocities)
        if config.senses_obstacle:
            start = 2 + 2 * CLASSES * config.sensors
            obs[..., start : start + config.sensors] = self._obstacle(own)
        if config.senses_touch:
            foods, poisons = touch.split([config.food, config.poison], 1)
            obs[..., -2:] = torch.stack((foods.any(1), poisons.any(1)), -1).transpose(0, 1).float()
        return obs

    def _sense_all(self, obs: Tensor, positions: Tensor, velocities: Tensor) -> None:
        """Write distances and velocities of what each sensor meets into `obs`, 0 there before.

        That is the nearest of each class (l. 389-390), with the velocity along the sensor.
        """
        config, agents, rays = self.config, self.config.pursuers, self.config.sensors
        cos, sin = self._cos[:, None], self._sin[:, None]  # [S, 1]
        away = positions[:, None] - positions[:, :agents, None]  # [2, N, N+M+L, B]
        x, y = away[..., None, :]  # [N, N+M+L, 1, B]
        distance = x * cos + y * sin  # [N, N+M+L, S, B]
        met = (distance >= 0) & (distance <= config.sensor_range)
        met &= (x * sin - y * cos).abs() <= self._widths[..., None]
        met &= (self._near > 0)[..., None]  # nobody senses itself
        distance = torch.where(met, distance + 0.0, math.inf)  # no -0
        first = 0
        for kind, number in enumerate(self._numbers):
            if number == 0:
                continue
            of_kind = distance[:, first : first + number]
            which = of_kind.argmin(1, keepdim=True)  # [N, 1, S, B], of equally near ones the first
            nearest = of_kind.gather(1, which)[:, 0]  # [N, S, B]
            others = velocities[:, first : first + number, None]
            others = others.expand(-1, -1, rays, -1)[:, None].expand(-1, agents, -1, -1, -1)
            other = others.gather(2, which.expand(2, -1, -1, -1, -1))[:, :, 0]  # [2, N, S, B]
            u, v = other - velocities[:, :agents, None]
            speed = u * cos + v * sin
            if config.sensors_scaled:
                nearest, speed = nearest / config.sensor_range, speed / config.velocity_unit
            start = 2 + kind * 2 * rays
            shown = torch.where(nearest < math.inf, torch.stack((nearest, speed)), 0.0)
            obs[..., start : start + 2 * rays] = shown.permute(3, 1, 0, 2).flatten(2)
            first += number

    def _sense(self, obs: Tensor, positions: Tensor, velocities: Tensor) -> None:
        """The same bits, of the pairs within reach alone: quicker where shapes may be asked for."""
        config, rays = self.config, self.config.sensors
        away = positions[:, None] - positions[:, : config.pursuers, None]  # [2, N, N+M+L, B]
        agent, entity, game = (dot(away, away) <= self._near).nonzero().unbind(1)  # [P] each
        apart = away[:, agent, entity, game, None]  # [2, P, 1]
        distance, aside = dot(apart, self._along), dot(apart, self._across)  # [P, S]
        met = (distance >= 0) & (distance <= config.sensor_range)
        met &= aside.abs() <= self._widths[entity]
        which, ray = met.nonzero().unbind(1)  # [H] each
        # The nearest on each sensor, of equally near ones the first: the least of (distance, order)
        # as one integer, for the bits of floats >= 0 are in the order of the floats.
        distance = distance[which, ray] + 0.0  # no -0
        column = (game * config.pursuers * self.size + self._columns[agent, entity])[which] + ray
        key = distance.view(torch.int32).long() << 32 | torch.arange(len(ray), device=ray.device)
        best = key.new_full((obs.numel(),), UNMET).scatter_reduce_(0, column, key, "amin")
        nearest = (best[column] == key).nonzero()[:, 0]
        distance, column = distance[nearest], column[nearest]
        which, ray = which[nearest], ray[nearest]
        motion = velocities[:, entity, game] - velocities[:, agent, game]  # [2, P]
        speed = dot(motion[:, which], self._along[:, 0, ray])
        if config.sensors_scaled:
            distance, speed = distance / config.sensor_range, speed / config.velocity_unit
        obs.view(-1).scatter_(0, column, distance).scatter_(0, column + rays, speed)

    def _obstacle(self, own: Tensor) -> Tensor:
        """Distance along each sensor to the obstacle's rim; own: [B, N, 2]; returns [B, N, S]."""
        x, y = (0.5 - own)[..., None].unbind(-2)  # [B, N, 1]
        along = x * self._cos + y * self._sin
        aside = x * self._sin - y * self._cos
        half = (self.config.obstacle_radius**2 - aside * aside).clamp(min=0)
        distance = along - half.sqrt()
        met = (half > 0) & (distance >= 0) & (distance <= self.config.sensor_range)
        distance = torch.where(met, distance, 0.0)
        return distance / self.config.sensor_range if self.config.sensors_scaled else distance
