"""Compare a policy with the fixed rule of the paper in scenario 1, over the latency of the channel.

    python examples/evaluate_policy.py --seeds 40 --latency 0 0.1 0.2 0.3 0.4 0.5 0.6

One row per latency, and one without messages: share of passed episodes of the rule (planner `conflict_area`) and of
the policy with 95 % Wilson intervals, and the mean duration of the passed ones [s]. Both drive the same episodes, none
of which training used.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from crossing_task import POLICY_FILE, Outcome, Policy, drive_by_rule, environment, play
from scipy.stats import binomtest

FIRST_SEED = 200_000


def summary(outcomes: Sequence[Outcome]) -> str:
    """Return the share of passed episodes, its interval, and the mean duration of the passed ones."""
    passed = [outcome.duration for outcome in outcomes if outcome.passed]
    rate = binomtest(len(passed), len(outcomes)).proportion_ci(method="wilson")
    duration = f"{fmean(passed):5.1f}" if passed else "    -"
    return f"{len(passed):3}/{len(outcomes)} {rate.low:5.0%} to {rate.high:4.0%} {duration}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--policy", type=Path, default=POLICY_FILE)
    parser.add_argument("--seeds", type=int, default=40, help="number of episodes per latency")
    parser.add_argument("--latency", type=float, nargs="+", default=[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6], help="[s]")
    given = parser.parse_args(arguments)
    if not given.policy.is_file():
        parser.error(f"--policy: {given.policy} does not exist; examples/train_policy.py writes one")
    if given.seeds < 1:
        parser.error("--seeds must be at least 1")
    policy = Policy.load(given.policy)
    seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
    print("latency  rule: passed    95 %    time   policy: passed    95 %    time")
    for latency in (*given.latency, None):
        env = environment(latency)
        rule = summary([drive_by_rule(latency, seed) for seed in seeds])
        name = "none" if latency is None else f"{latency:.2f}"
        print(f"{name:>7}  {rule}   {summary([play(env, policy, seed) for seed in seeds])}", flush=True)
        env.close()


if __name__ == "__main__":
    main()
