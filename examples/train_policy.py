"""Train a policy for scenario 1 under latency by the cross-entropy method, and draw its learning curve.

    python examples/train_policy.py --out policy.npz --curve curve.csv --plot curve.png

In each generation all candidates drive the same new episodes, one per latency. The distribution of their weights moves
to those with the highest rewards. Its mean drives a fixed set of episodes, which training does not use: the curve has
the mean reward and the share of passed episodes there. The policy is the mean of the generation with the most passed
episodes, and of those the one with the highest reward. Eleven generations take a few minutes on two cores.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from statistics import fmean

import numpy as np
from crossing_task import LATENCIES, Floats, Outcome, Policy, environment, play

from eidrive_scenario.gym import EidriveEnv

POPULATION = 40
ELITE_SHARE = 0.2
"""Share of the candidates to which the distribution moves."""
SPREAD, LEAST_SPREAD = 0.8, 0.08
"""Standard deviation of the weights at the start, and its minimum."""
FIRST_SEED = 100_000
"""First seed of the fixed set of episodes."""


@cache
def shared_environment(latency: float) -> EidriveEnv:
    """Return the environment of this process with a latency [s]."""
    return environment(latency)


def drive(weights: Floats, latency: float, seed: int) -> Outcome:
    """Play an episode with these weights."""
    return play(shared_environment(latency), Policy(weights), seed)


def outcomes(pool: ProcessPoolExecutor, candidates: Sequence[Floats], seeds: Sequence[int]) -> list[list[Outcome]]:
    """Return the outcomes of each candidate in all latencies and seeds."""
    episodes = [(latency, seed) for latency in LATENCIES for seed in seeds]
    jobs = [(weights, latency, seed) for weights in candidates for latency, seed in episodes]
    results = list(pool.map(drive, *zip(*jobs, strict=True), chunksize=len(episodes)))
    return [results[n : n + len(episodes)] for n in range(0, len(results), len(episodes))]


def train(
    generations: int, population: int, episodes: int, seed: int, workers: int | None
) -> tuple[Floats, list[tuple[int, float, float]]]:
    """Return the weights, and the curve: generation, mean reward and share of passed episodes of the fixed set.

    episodes  number of episodes of the fixed set per latency
    """
    rng = np.random.default_rng(seed)
    elites, fixed = max(round(ELITE_SHARE * population), 1), range(FIRST_SEED, FIRST_SEED + episodes)
    mean, spread = np.zeros(Policy.size), np.full(Policy.size, SPREAD)
    curve: list[tuple[int, float, float]] = []
    means = []
    with ProcessPoolExecutor(workers) as pool:
        for generation in range(generations + 1):
            (driven,) = outcomes(pool, [mean], fixed)
            passed, reward = (fmean(getattr(outcome, name) for outcome in driven) for name in ("passed", "reward"))
            print(f"generation {generation:3}: passes {passed:4.0%}, reward {reward:6.2f}", flush=True)
            curve.append((generation, reward, passed))
            means.append(mean)
            if generation < generations:
                candidates = [mean + spread * rng.standard_normal(len(mean)) for _ in range(population)]
                rewards = [
                    fmean(outcome.reward for outcome in driven)
                    for driven in outcomes(pool, candidates, [int(rng.integers(2**31))])
                ]
                best = np.array(candidates)[np.argsort(rewards, kind="stable")[-elites:]]
                mean, spread = best.mean(axis=0), np.maximum(best.std(axis=0), LEAST_SPREAD)
    chosen = max(curve, key=lambda point: (point[2], point[1]))[0]
    return means[chosen], curve


def draw(curve: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Write the curve as a picture."""
    from matplotlib.figure import Figure

    generation, reward, passed = zip(*curve, strict=True)
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    left = figure.subplots()
    right = left.twinx()
    left.plot(generation, [100.0 * share for share in passed], "C0-", label="passed episodes")
    right.plot(generation, reward, "C1--", label="mean reward")
    left.set(xlabel="generation", ylabel="passed [%]", ylim=(0.0, 102.0))
    right.set(ylabel="reward")
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=110)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--generations", type=int, default=11)
    parser.add_argument("--population", type=int, default=POPULATION, help="candidates of a generation")
    parser.add_argument("--episodes", type=int, default=10, help="episodes of the fixed set per latency")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, help="processes (default: number of cores)")
    parser.add_argument("--out", type=Path, default=Path("policy.npz"))
    parser.add_argument("--curve", type=Path, help="CSV file: generation, reward, share of passed episodes")
    parser.add_argument("--plot", type=Path, help="PNG file")
    given = parser.parse_args(arguments)
    if min(given.generations, given.population, given.episodes) < 1:
        parser.error("--generations, --population and --episodes must be at least 1")
    weights, curve = train(given.generations, given.population, given.episodes, given.seed, given.workers)
    np.savez(given.out, weights=weights)
    print(f"wrote {given.out}: passes {max(passed for *_, passed in curve):.0%} of the fixed set")
    if given.curve:
        with given.curve.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream, lineterminator="\n").writerows([("generation", "reward", "passed"), *curve])
    if given.plot:
        draw(curve, given.plot)


if __name__ == "__main__":
    main()
