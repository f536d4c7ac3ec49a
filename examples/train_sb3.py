"""Train a policy for scenario 1 under latency by PPO of Stable-Baselines3, and state its share of passed episodes.

    pip install stable-baselines3
    python examples/train_sb3.py --steps 100000 --out crossing_ppo.zip

Each environment has a separate process and one of the latencies of the task (`crossing_task.py`). The same seed gives
the same episodes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from crossing_task import LATENCIES, environment, start
from gymnasium import Env, Wrapper
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv


class RandomStarts(Wrapper[Any, Any, Any, Any]):
    """Environment whose episodes begin with the positions and speeds of successive seeds."""

    def __init__(self, env: Env[Any, Any], first_seed: int) -> None:
        super().__init__(env)
        self._seed = first_seed

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        self._seed += 1
        return self.env.reset(seed=seed, options={"seed": self._seed, "parameters": start(self._seed)})


def make(latency: float, first_seed: int) -> Env[Any, Any]:
    """Return an environment of the task."""
    return RandomStarts(environment(latency), first_seed)


def makers(first_seed: int) -> list[Callable[[], Env[Any, Any]]]:
    """Return the functions that make one environment for each latency."""
    return [partial(make, latency, first_seed + 10_000 * number) for number, latency in enumerate(LATENCIES)]


def passed_share(model: PPO, latency: float, episodes: int) -> float:
    """Return the share of passed episodes that training has not used."""
    env = make(latency, first_seed=900_000)
    passed = []
    for _ in range(episodes):
        observation, info = env.reset()
        ended = False
        while not ended:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        passed.append(info["passed"])
    env.close()
    return float(np.mean(passed))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--episodes", type=int, default=20, help="episodes per latency for the share of passed ones")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("crossing_ppo.zip"))
    options = parser.parse_args()
    model = PPO("MultiInputPolicy", SubprocVecEnv(makers(first_seed=0)), n_steps=256, seed=options.seed, device="cpu")
    model.learn(options.steps)
    model.save(options.out)
    model.get_env().close()
    print("latency [s]  passed")
    for latency in LATENCIES:
        print(f"{latency:11g}  {passed_share(model, latency, options.episodes):.2f}")


if __name__ == "__main__":
    main()
