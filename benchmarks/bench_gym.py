"""Steps of the learning environment per second of processor time: scenario 1 with the oracle detector, one core.

    python benchmarks/bench_gym.py [--episodes 20]

An episode includes its reset, in which the scenario is loaded for a new seed. The second number is that of the same
runs without the environment: `Simulation` with the planner `route`, which has neither observations nor rewards.
"""

from __future__ import annotations

import argparse
import time

from eidrive_scenario.api.run import RunSettings, Simulation, load_scenario
from eidrive_scenario.gym import EidriveEnv

SCENARIO = "coop/scenario_1"


def environment_rate(episodes: int) -> tuple[float, float]:
    """Return steps per second with and without the resets."""
    env = EidriveEnv(SCENARIO, terminate_on_collision=False)
    steps, resets = 0, 0.0
    started = time.process_time()
    for seed in range(episodes):
        before = time.process_time()
        env.reset(seed=seed)
        resets += time.process_time() - before
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step([0.0])
            ended = terminated or truncated
            steps += 1
    elapsed = time.process_time() - started
    return steps / elapsed, steps / (elapsed - resets)


def simulation_rate(episodes: int) -> float:
    """Return ticks per second of the same scenario without the environment."""
    scenario, ticks = load_scenario(SCENARIO), 0
    started = time.process_time()
    for seed in range(episodes):
        with Simulation(scenario, seed=seed, settings=RunSettings(planner="route")) as simulation:
            end = None
            while end is None:
                _, end = simulation.tick()
                ticks += 1
    return ticks / (time.process_time() - started)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--episodes", type=int, default=20)
    episodes = parser.parse_args().episodes
    # Fill caches, which the first measurement would pay for
    environment_rate(1)
    simulation_rate(1)
    with_resets, without_resets = environment_rate(episodes)
    print(f"environment: {with_resets:.0f} steps per second, {without_resets:.0f} without resets")
    print(f"simulation:  {simulation_rate(episodes):.0f} ticks per second with loading")


if __name__ == "__main__":
    main()
