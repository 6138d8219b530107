"""How well variance components are recovered: the evidence for docs/sensitivity.md.

    python -m benchmarks.evidence.components [--runs 1000] [--seed 0]

Scores of 40 items under two or three levels in 16 or 4 blocks and two repeats are drawn with known
components, items of a base scene each or of two that they share with others (25 base scenes).
"""

from __future__ import annotations

import argparse

import numpy as np

from phyblock.scoring.statistics import Clusters, interaction, shift, within

ITEMS, BASES, REPEATS = 40, 25, 2
DESIGNS = {
    "as sensitivity.yaml": {},
    "three levels": {"levels": 3},
    "one other factor": {"blocks": 2},
    "no shift": {"moved": 0.0},
    "no interaction": {"single": 0.0},
    "items share base scenes": {"shared": True},
}
FORMER = (91.8, 92.6, 93.8, 93.0, 94.6, 90.0)
"""Coverage of intervals of single items by design, with degrees of freedom unbounded (500 runs)."""


def design(
    rng: np.random.Generator,
    levels: int = 2,
    blocks: int = 16,
    moved: float = 0.03,
    single: float = 0.08,
    noise: float = 0.1,
    shared: bool = False,
) -> tuple[dict[str, float], np.ndarray, Clusters]:
    """The true components, scores (items, levels, blocks, repeats), and base scenes."""
    steps = np.linspace(-1, 1, levels)
    steps *= moved / steps.std(ddof=1)
    parents = [(str(n),) for n in range(ITEMS)]
    own = rng.normal(0, single, (ITEMS, levels))
    if shared:
        pairs = rng.integers(0, BASES, (ITEMS, 2))
        parents = [(str(a), str(b)) for a, b in pairs]
        of_base = rng.normal(0, single, (BASES, levels))
        own = of_base[pairs].sum(axis=1) / np.sqrt(2)
    scores = rng.normal(0, 0.3, (ITEMS, 1, 1, 1)) + steps[None, :, None, None]
    scores = scores + own[:, :, None, None]
    scores = scores + rng.normal(0, 0.05, (ITEMS, levels, blocks, 1))
    scores = scores + rng.normal(0, noise, (ITEMS, levels, blocks, REPEATS))
    truth = {"shift": moved, "single items": single, "asked again": noise}
    return truth, scores, Clusters.of(parents)


def main() -> None:
    """Print, for each design and component, its truth, its mean estimate, and coverage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    print(f"{options.runs} runs of {ITEMS} items; SD in points: true, estimated, coverage (%)")
    for former, (name, how) in zip(FORMER, DESIGNS.items(), strict=True):
        sums: dict[str, list[float]] = {}
        truth: dict[str, float] = {}
        for _ in range(options.runs):
            truth, scores, clusters = design(rng, **how)  # type: ignore[arg-type]
            cells = scores.mean(axis=3)
            found = {
                "shift": shift(cells, clusters),
                "single items": interaction(cells, clusters),
                "asked again": within(scores.reshape(ITEMS, -1, REPEATS), clusters),
            }
            for part, one in found.items():
                total = sums.setdefault(part, [0.0, 0.0])
                total[0] += one.sd**2 / options.runs
                total[1] += (one.lo <= truth[part] + 1e-9 <= one.hi + 2e-9) / options.runs
        cells_of = (
            f"{part} {100 * truth[part]:4.1f} {100 * np.sqrt(square):4.1f} {100 * hit:5.1f}"
            for part, (square, hit) in sums.items()
        )
        print(f"  {name:24} {'; '.join(cells_of)}; single items before {former}")


if __name__ == "__main__":
    main()
