"""Which scenes a run asks about: by level, and a stratified few of them under a limit."""

from __future__ import annotations

from collections.abc import Sequence

from phyblock.datasets import AssemblyTask

__all__ = ["select_tasks", "stratified"]


def select_tasks(
    tasks: Sequence[AssemblyTask], levels: Sequence[int], limit: int | None
) -> tuple[AssemblyTask, ...]:
    """The tasks counted in any of `levels`, at most `limit` of them, in their order."""
    chosen = [task for task in tasks if set(task.scene.levels) & set(levels)]
    if limit is None or limit >= len(chosen):
        return tuple(chosen)
    by_level: dict[int, list[int]] = {}
    for position, task in enumerate(chosen):
        by_level.setdefault(task.scene.level, []).append(position)
    shares = stratified([len(by_level[level]) for level in sorted(by_level)], limit)
    kept: set[int] = set()
    for level, share in zip(sorted(by_level), shares, strict=True):
        positions = by_level[level]
        kept.update(positions[i * len(positions) // share] for i in range(share))
    return tuple(task for position, task in enumerate(chosen) if position in kept)


def stratified(sizes: Sequence[int], limit: int) -> list[int]:
    """`limit` places shared among groups of the given sizes by largest remainder.

    Every group gets at least one place where the limit allows; none gets more than its size.
    """
    total = sum(sizes)
    if limit >= total:
        return list(sizes)
    exact = [limit * size / total for size in sizes]
    shares = [int(share) for share in exact]
    if limit >= len(sizes):
        shares = [max(1, share) for share in shares]
    while sum(shares) != limit:
        step = 1 if sum(shares) < limit else -1
        gaps = [step * (want - share) for want, share in zip(exact, shares, strict=True)]
        open_to = [
            i
            for i, share in enumerate(shares)
            if (share < sizes[i] if step > 0 else share > min(1, limit // len(sizes)))
        ]
        shares[max(open_to, key=lambda i: (gaps[i], -i))] += step
    return shares
