"""What a suite may vary: factors that its tracks know, and values that its other fields allow."""

from __future__ import annotations

from collections.abc import Iterator

from phyblock.errors import Problem
from phyblock.registry import known_tracks
from phyblock.specs.rules import broken_rules, read_dotted
from phyblock.specs.suite import SuiteSpec
from phyblock.specs.words import show
from phyblock.specs.yaml_source import YamlSource, dotted
from phyblock.variants import Variant

__all__ = ["vary_problems"]

_DRAWN = ("background", "view")
"""Factors of pictures that are drawn."""


def vary_problems(suite: SuiteSpec, source: YamlSource) -> Iterator[Problem]:
    """What is wrong with the section `vary` of a suite, each fault at its place in the file."""
    for factor in suite.vary.factors:
        at = ("vary", factor)
        unknown = [name for name in suite.tracks if factor not in known_tracks()[name].varies]
        if unknown:
            known = known_tracks()[unknown[0]].varies
            message, allowed = f"has no meaning in {unknown[0]}", ", ".join(known)
            yield Problem(source.where(at, key=True), message, dotted(at), allowed=allowed)
        elif factor == "prompt" and len(suite.tracks) > 1:
            message = "is varied in a suite of several tracks, each of which has its own"
            hint = "run one track at a time"
            yield Problem(source.where(at, key=True), message, dotted(at), hint=hint)
        elif factor in _DRAWN and suite.images.source == "dataset":
            message = "cannot be varied in the data set's own pictures"
            hint = "use images.source: render"
            yield Problem(source.where(at, key=True), message, dotted(at), hint=hint)
        else:
            yield from _conflicts(suite, source, factor)
            yield from _levels(suite, source, factor)


def _conflicts(suite: SuiteSpec, source: YamlSource, factor: str) -> Iterator[Problem]:
    """A field that says something else than the reference of the factor that varies it."""
    for path in suite.fields_of(factor):
        value, first = read_dotted(suite, dotted(path)), suite.vary.values(factor)[0]
        if path in source.values and value != first:
            message = f"is varied by vary.{factor}, whose first level is the reference"
            hint = "leave it out, or change vary"
            yield Problem(source.where(path), message, dotted(path), show(value), str(first), hint)


def _levels(suite: SuiteSpec, source: YamlSource, factor: str) -> Iterator[Problem]:
    """Levels that break a rule of suites."""
    for place, level in enumerate(suite.vary.names(factor)):
        at = ("vary", factor, place)
        if level == "official" and suite.fields_of(factor) != (("prompt",),):
            message, allowed = "is no prompt of this track", "default, or the path of a .j2 file"
            yield Problem(source.where(at), message, dotted(at), level, allowed)
            continue
        one = suite.at(Variant(((factor, level),)))
        before = broken_rules(lambda name: read_dotted(suite, name))
        for rule in broken_rules(lambda name, one=one: read_dotted(one, name)):  # type: ignore[misc]
            if rule not in before:
                yield Problem(source.where(at), rule.message, dotted(at), level, hint=rule.hint)
