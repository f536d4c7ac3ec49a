"""Task of a policy that drives scenario 1 under latency, and the policy itself: a small network of numpy.

The ego of `coop/scenario_1` drives along its route, and the policy sets its target speed ten times per second. Starts
differ by up to 2 m and speeds by up to 1 m/s, and the channel delays messages. `train_policy.py` and
`evaluate_policy.py` use this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.api.run import RunSettings, Simulation
from eidrive_scenario.gym import EidriveEnv

Floats = NDArray[np.float64]

SCENARIO = "coop/scenario_1"
POLICY_FILE = Path(__file__).with_name("crossing_policy.npz")
LATENCIES = (0.0, 0.15, 0.3, 0.45, 0.6)
"""Latencies of the channel in training [s]."""
SPREAD = {"EgoOffset": 2.0, "IncomingOffset": 2.0, "EgoSpeedOffset": 1.0, "IncomingSpeedOffset": 1.0}
"""Largest deviations of starts [m] and speeds [m/s]."""
MAX_SPEED = 9.0
"""Largest target speed of the policy [m/s]."""
TIME_LIMIT = 20.0
MOVING = 2.0
"""Speed from which on an object counts as moving [m/s]."""
REWARD = {"progress": 0.1, "collision": -10.0, "comfort": -0.002, "time": -0.2, "passed": 5.0}
FEATURES, HIDDEN = 8, 8


def channel(latency: float | None) -> str:
    """Return the channel with a latency [s]; None: without messages."""
    return "none" if latency is None else f"{{delay: {{kind: constant, seconds: {latency}}}}}"


def settings(latency: float | None, **options: Any) -> RunSettings:
    """Return the settings of a run with a latency [s], or without messages."""
    return RunSettings(channel=channel(latency), time_limit=TIME_LIMIT, **options)


def start(seed: int) -> dict[str, str]:
    """Return the parameters of an episode: deviations of starts and speeds."""
    rng = np.random.default_rng(seed)
    return {name: repr(float(rng.uniform(-most, most))) for name, most in SPREAD.items()}


def environment(latency: float | None, **options: Any) -> EidriveEnv:
    """Return the environment with a latency [s], or without messages."""
    return EidriveEnv(
        SCENARIO,
        observation={"normalized": False, "route": False, "senders": True, "tracks": {"count": 6, "range": 80.0}},
        action={"kind": "target_speed", "max_speed": MAX_SPEED},
        reward=REWARD,
        settings=settings(latency),
        ticks_per_step=2,
        **options,
    )


def features(observation: dict[str, Any]) -> Floats:
    """Return what the policy uses, (FEATURES,): own speed, age of the message, and the fastest moving object.

    The object is described by its position and velocity in the frame of the vehicle, and by the time until it crosses
    the own path, at most 5 s.
    """
    received, age = observation["senders"][0]
    values = np.zeros(FEATURES)
    values[:2] = observation["ego"][0] / 10.0, age if received else 1.0
    tracks = observation["tracks"]
    speeds = np.hypot(tracks[:, 3], tracks[:, 4]) * (tracks[:, 0] > 0.0)
    fastest = int(np.argmax(speeds))
    if speeds[fastest] < MOVING:
        return values
    x, y, vx, vy = tracks[fastest, 1:5]
    until = min(-y / vy, 5.0) if y * vy < 0.0 else 5.0
    values[2:] = 1.0, x / 30.0, y / 30.0, vx / 15.0, vy / 15.0, until / 5.0
    return values


@dataclass(frozen=True)
class Policy:
    """Network with one hidden layer. Its output is the target speed, from -1 for standstill to 1 for MAX_SPEED."""

    weights: Floats

    size = HIDDEN * (FEATURES + 1) + HIDDEN + 1

    def __call__(self, observation: dict[str, Any]) -> NDArray[np.float32]:
        """Return the action."""
        first, last = np.split(self.weights, [HIDDEN * (FEATURES + 1)])
        first = first.reshape(HIDDEN, FEATURES + 1)
        hidden = np.tanh(first[:, :-1] @ features(observation) + first[:, -1])
        speed: NDArray[np.float32] = np.tanh([last[:-1] @ hidden + last[-1] + 1.5]).astype(np.float32)
        return speed

    @classmethod
    def load(cls, path: Path = POLICY_FILE) -> Policy:
        """Read a policy that `train_policy.py` has written."""
        with np.load(path) as arrays:
            return cls(arrays["weights"])


@dataclass(frozen=True)
class Outcome:
    """End of an episode: whether it passed, its duration [s] and the sum of its rewards."""

    passed: bool
    duration: float
    reward: float = float("nan")


def play(env: EidriveEnv, policy: Policy, seed: int) -> Outcome:
    """Play an episode."""
    observation, info = env.reset(options={"seed": seed, "parameters": start(seed)})
    total, ended = 0.0, False
    while not ended:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        total += reward
        ended = terminated or truncated
    return Outcome(info["passed"], info["result"].simulated_s, total)


def drive_by_rule(latency: float | None, seed: int) -> Outcome:
    """Run the same episode with the rule of the paper, the planner `conflict_area`."""
    run = settings(latency, planner="conflict_area", parameters=start(seed))
    with Simulation(SCENARIO, seed=seed, settings=run) as simulation:
        result = simulation.run()
    return Outcome(result.passed, result.simulated_s)
