"""Made-up worlds of scenes in which the true F1 is known, to see what intervals are worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phyblock.scoring.plan import Floats
from phyblock.scoring.statistics import Clusters


@dataclass(frozen=True)
class World:
    """`bases` base scenes, each a scene of its own, and `pairs` scenes made of two of them.

    A block is placed rightly with log odds `ease` (less `harder` in a pair), plus what the base
    scene adds (sd `base_sd`, the mean of the two in a pair), plus what the scene alone adds
    (sd `scene_sd`). Every plan is as long as its goal.
    """

    bases: int = 150
    pairs: int = 250
    base_sd: float = 1.2
    scene_sd: float = 0.3
    ease: float = -0.4
    harder: float = 0.5

    def draw(self, rng: np.random.Generator, models: int = 1) -> tuple[Floats, Clusters, Floats]:
        """Counts (scenes, models, [tp, fp, fn]), clusters, and the expected tp and blocks.

        All models share half the variance of each effect.
        """
        first, second = self._parents(rng)
        single = first == second
        sizes = rng.integers(3, 11, self.bases)
        blocks = np.where(single, sizes[first], sizes[first] + sizes[second])
        base = self._effects(rng, self.base_sd, self.bases, models)
        scene = self._effects(rng, self.scene_sd, len(first), models)
        odds = self.ease + (base[first] + base[second]) / 2 + scene
        odds -= np.where(single, 0.0, self.harder)[:, None]
        chance = 1 / (1 + np.exp(-odds))
        right = rng.binomial(blocks[:, None], chance).astype(np.float64)
        left = blocks[:, None] - right
        counts = np.stack([right, left, left], axis=-1)
        parents = [[str(a), str(b)] for a, b in zip(first, second, strict=True)]
        expected = np.array([(blocks[:, None] * chance).sum(axis=0)[0], blocks.sum()])
        return counts, Clusters.of(parents), expected

    def true_f1(self, rng: np.random.Generator, worlds: int = 300) -> float:
        """F1 of endlessly many scenes, from `worlds` drawings."""
        right, blocks = sum(self.draw(rng)[2] for _ in range(worlds))
        return float(right / blocks)

    def _parents(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        alone = np.arange(self.bases)
        couples = np.array([(a, b) for a in alone for b in alone[:a]], dtype=np.intp).reshape(-1, 2)
        chosen = couples[rng.choice(len(couples), self.pairs, replace=False)]
        return np.concatenate([alone, chosen[:, 0]]), np.concatenate([alone, chosen[:, 1]])

    @staticmethod
    def _effects(rng: np.random.Generator, sd: float, size: int, models: int) -> Floats:
        shared, own = rng.normal(0, sd, (size, 1)), rng.normal(0, sd, (size, models))
        return np.asarray((shared + own) / np.sqrt(2))
