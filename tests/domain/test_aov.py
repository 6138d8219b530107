"""Laws of the AOV graph."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import AOVGraph, CycleError
from tests.scoring.cases import acyclic, any_edges

SEEDS = st.integers(0, 2**32 - 1)


def masks(graph: AOVGraph) -> st.SearchStrategy[int]:
    return st.integers(0, (1 << len(graph)) - 1)


@given(edges=acyclic())
def test_a_layer_is_one_above_the_highest_that_carries_it(edges):
    graph = AOVGraph(edges)
    for vertex, needed in enumerate(edges):
        assert graph.layers[vertex] == 1 + max((graph.layers[w] for w in needed), default=0)


@given(edges=acyclic(), data=st.data())
def test_ready_is_what_is_unplaced_and_wholly_carried(edges, data):
    graph = AOVGraph(edges)
    placed = data.draw(masks(graph))
    inside = {v for v in range(len(graph)) if placed & 1 << v}
    expected = [v for v in range(len(graph)) if v not in inside and edges[v] <= inside]
    assert list(graph.ready(placed)) == expected
    assert [v for v in range(len(graph)) if graph.is_ready(v, placed)] == expected


@given(edges=acyclic(), data=st.data())
def test_placing_more_never_makes_a_waiting_block_unready(edges, data):
    graph = AOVGraph(edges)
    placed, more = data.draw(masks(graph)), data.draw(masks(graph))
    still_waiting = {v for v in graph.ready(placed) if not more & 1 << v}
    assert still_waiting <= set(graph.ready(placed | more))


@given(edges=acyclic(max_size=5))
def test_valid_orders_are_the_permutations_that_respect_every_dependency(edges):
    graph = AOVGraph(edges)
    for order in itertools.permutations(range(len(graph))):
        at = {vertex: i for i, vertex in enumerate(order)}
        respects = all(at[w] < at[v] for v, needed in enumerate(edges) for w in needed)
        assert graph.is_valid(order) == respects


@given(edges=acyclic(), seed=SEEDS)
def test_a_random_order_is_valid_and_set_by_its_seed(edges, seed):
    graph = AOVGraph(edges)
    order = graph.random_order(np.random.default_rng(seed))
    assert graph.is_valid(order)
    assert order == graph.random_order(np.random.default_rng(seed))


@given(edges=acyclic().filter(bool), seed=SEEDS, data=st.data())
def test_an_order_that_is_not_a_permutation_is_not_valid(edges, seed, data):
    graph = AOVGraph(edges)
    order = list(graph.random_order(np.random.default_rng(seed)))
    i = data.draw(st.integers(0, len(order) - 1))
    assert not graph.is_valid(order[:i] + order[i + 1 :])
    assert not graph.is_valid([*order, order[i]])
    assert not graph.is_valid([*order[:i], len(graph), *order[i + 1 :]])
    assert not graph.is_valid([*order[:i], -1, *order[i + 1 :]])


def test_random_orders_reach_every_order():
    graph = AOVGraph((frozenset(), frozenset(), frozenset({0}), frozenset()))
    rng = np.random.default_rng(7)
    drawn = {graph.random_order(rng) for _ in range(400)}
    assert drawn == {o for o in itertools.permutations(range(4)) if graph.is_valid(o)}


@given(edges=any_edges())
def test_a_graph_is_refused_exactly_when_no_order_exists(edges):
    left = set(range(len(edges)))
    while free := {v for v in left if not edges[v] & left}:
        left -= free
    if not left:
        assert AOVGraph(edges).is_valid(AOVGraph(edges).random_order(np.random.default_rng(0)))
        return
    with pytest.raises(CycleError) as caught:
        AOVGraph(edges)
    cycle = caught.value.vertices
    assert len(set(cycle)) == len(cycle) >= 1
    assert all(after in edges[v] for v, after in zip(cycle, cycle[1:] + cycle[:1], strict=True))


@pytest.mark.parametrize("other", [-1, 2])
def test_a_dependency_outside_the_graph_is_refused(other):
    with pytest.raises(ValueError, match=r"vertex 1 depends on -?\d, outside 0\.\.1"):
        AOVGraph((frozenset(), frozenset({other})))


def test_a_long_chain_needs_no_deep_recursion():
    n = 3000
    chain = AOVGraph(tuple(frozenset({v + 1}) if v + 1 < n else frozenset() for v in range(n)))
    assert chain.ready() == (n - 1,)
