"""Compare link quality under rising channel load: IEEE 802.11p with background traffic and congestion control.

    python examples/channel_load.py --density 0.01 0.06 0.12

One row per density of background vehicles [1/m]: busy ratio at the ego, delivery ratio of the link from the roadside
unit to the ego, mean age of information [s], and the most frequent reason for a loss.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from eidrive_scenario.api.run import RunSettings, run_file

LINK = ("RSU", "Ego")
CHANNEL = (
    "{{model: radio, technology: 80211p, tx_power_dbm: 23, antenna_gain_dbi: 3, "
    "path_loss: {{kind: tr37885, environment: urban}}, "
    "background: {{kind: 80211p, density: {density}, rate: 25, size: 500, power_dbm: 23}}}}"
)


def row(density: float, seed: int) -> str:
    """Run scenario 1 under a density of background vehicles [1/m] and return one line of the table."""
    result = run_file("coop/scenario_1", seed=seed, settings=RunSettings(channel=CHANNEL.format(density=density)))
    link = result.links[LINK]
    delivered = link.received / max(link.received + link.lost, 1)
    reason = max(link.lost_by, key=lambda name: link.lost_by[name], default="-")
    busy = 0.0 if link.channel_busy_ratio is None else link.channel_busy_ratio
    age = float("nan") if link.mean_age is None else link.mean_age
    return f"{density:7.3f}  {busy:10.2f}  {delivered:14.2f}  {age:10.3f}  {reason}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--density", type=float, nargs="+", default=[0.01, 0.03, 0.06, 0.12], help="[1/m]")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    print("density  busy_ratio  delivery_ratio  mean_age_s  most frequent loss")
    for density in given.density:
        print(row(density, given.seed))


if __name__ == "__main__":
    main()
