"""The settings of waterworld, which its rules (`rules.py`) and its sensors both read."""

from dataclasses import dataclass, field
from typing import Literal

MOST = 1_000
"""Things of a kind, and sensors: tables of more are made for minutes, before anything could be said
of memory (ours)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a game; the defaults are the paper's N=8 case (l. 394).

    Lengths are in sides of the square. "Figure" is figure 2c of the paper, measured.
    """

    pursuers: int = 8
    """N (paper l. 394)."""
    catchers: int = 4
    """K, pursuers that must touch a food at once (paper l. 394)."""
    food: int = 10
    """M (figure; MADRL's runner)."""
    poison: int = 10
    """L (figure; MADRL's runner)."""
    radius: float = 0.02
    """Of a pursuer (figure; MADRL has 0.015)."""
    food_size: float = 2.0
    """Radius of food in radii of a pursuer (figure; MADRL)."""
    poison_size: float = 0.75
    """Radius of poison in radii of a pursuer (figure; MADRL)."""
    obstacle_radius: float = 0.2
    """Of the obstacle in the middle of the square (figure; MADRL)."""
    sensors: int = 25
    """Sensors of a pursuer, evenly around it, the first to the east (paper l. 389)."""
    sensor_range: float = 0.15
    """Length of a sensor (figure; MADRL has 0.2)."""
    sensor_width: Literal["own", "object"] = "own"
    """A sensor meets an object whose centre is within this radius of it: the pursuer's (MADRL) or
    the object's (PettingZoo)."""
    sensors_scaled: bool = True
    """Show position x 2 - 1, distance / range, velocity / `velocity_unit`; raw learns slower."""
    velocity_unit: float = 0.02
    """What is shown as velocity 1 if scaled (ours: of the order that pursuers reach)."""
    senses_obstacle: bool = False
    """Also show a distance to the obstacle for each sensor (MADRL; the paper names none)."""
    senses_touch: bool = False
    """Also show whether food, and whether poison, is touched (MADRL; the paper names none)."""
    time_limit: int = 500
    """T, steps (paper l. 394)."""
    catch_reward: float = 10.0
    """R1+, to every pursuer that touches a caught food (paper l. 394)."""
    touch_reward: float = 0.01
    """R2+, to every pursuer that touches a food (paper l. 394)."""
    poison_penalty: float = 0.1
    """R1-, to every pursuer that touches a poison (paper l. 394)."""
    rewards_once: bool = True
    """Pay each kind of reward at most once a step, as MADRL does, even for two foods."""
    action_penalty: float = 5e-5
    """Times |action|^2 (paper l. 393: the "square norm of the action", no factor; MADRL: 0.5 times
    that of the acceleration). The literal 1.0 would swamp all rewards but R1+."""
    acceleration: float = 0.01
    """Change of velocity in a step by an action of 1 (MADRL)."""
    food_speed: float = 0.01
    """Each axis of a new food's velocity is uniform within half of this around 0 (MADRL)."""
    poison_speed: float = 0.01
    """The same for poison (MADRL)."""
    food_bounce: Literal["half", "full"] = "half"
    """At the obstacle food's velocity v becomes -v / 2 (MADRL; it may stay at the rim) or -v."""
    object_walls: Literal["turn", "stop"] = field(default="turn", metadata={"later": True})
    """At a wall food and poison turn back, or stop as pursuers do (PAPER.md; MADRL loses them)."""

    def __post_init__(self) -> None:
        for name in ("pursuers", "catchers", "food", "sensors", "time_limit"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("pursuers", "food", "poison", "sensors"):
            if getattr(self, name) > MOST:
                raise ValueError(f"{name} must be at most {MOST:,}, not {getattr(self, name):,}")
        for name in ("radius", "food_size", "poison_size", "sensor_range", "velocity_unit"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        for name in ("poison", "obstacle_radius", "food_speed", "poison_speed"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if self.catchers > self.pursuers:
            raise ValueError(f"catchers must be at most the {self.pursuers} pursuers")
        if max(map(self.berth, self.radii)) >= 0.5:
            raise ValueError("the obstacle and twice the largest radius must stay below 0.5")

    @property
    def radii(self) -> tuple[float, float, float]:
        """Of a pursuer, a food, a poison."""
        return self.radius, self.food_size * self.radius, self.poison_size * self.radius

    def berth(self, radius: float) -> float:
        """How far from the middle something of this radius begins (MADRL)."""
        return self.obstacle_radius + 2 * radius


PAPER = {
    "waterworld-n8": Config(),
    "waterworld-n10": Config(pursuers=10, catchers=5),
}
