"""Random dependency graphs."""

from __future__ import annotations

from hypothesis import strategies as st

Edges = tuple[frozenset[int], ...]


@st.composite
def acyclic(draw: st.DrawFn, max_size: int = 7) -> Edges:
    """Dependencies of up to `max_size` vertices without a cycle, in any file order."""
    n = draw(st.integers(0, max_size))
    rank = draw(st.permutations(range(n)))
    return tuple(
        frozenset(w for w in range(n) if rank[w] < rank[v] and draw(st.booleans()))
        for v in range(n)
    )


@st.composite
def any_edges(draw: st.DrawFn, max_size: int = 6) -> Edges:
    """Dependencies of 1 to `max_size` vertices, mostly with cycles."""
    n = draw(st.integers(1, max_size))
    return tuple(frozenset(draw(st.sets(st.integers(0, n - 1), max_size=2))) for _ in range(n))
