"""Numbers as linear forms with exact rational factors, and as the largest or smallest of several.

A comparison of forms is multiplied by what makes every factor whole, so nothing is ever rounded.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from rtshcua.model.flat.code import MAX_INSTRUCTIONS


class TooManyForms(Exception):
    """A number is a choice among more sums than fit on board in one condition."""


class Variable(NamedTuple):
    """A state slot, or an argument cell."""

    argument: bool
    at: int


@dataclass(frozen=True, slots=True)
class Linear:
    """The sum of `terms` and `constant`. A variable whose factor is 0 stays: without it the number is not known."""

    terms: Mapping[Variable, Fraction]
    constant: Fraction

    leaves = 1


@dataclass(frozen=True, slots=True)
class Choice:
    """The largest (`most`) or the smallest of several numbers; `leaves` counts the linear forms in it."""

    most: bool
    among: tuple["Form", ...]
    leaves: int


Form: TypeAlias = Linear | Choice


def constant(value: Fraction) -> Linear:
    """A number that is known."""
    return Linear({}, value)


def choice(most: bool, among: Sequence[Form]) -> Form:
    """The largest or the smallest of some forms; of numbers that are all known, that number."""
    known = [form.constant for form in among if isinstance(form, Linear) and not form.terms]
    if len(known) == len(among):
        return constant(max(known) if most else min(known))
    leaves = sum(form.leaves for form in among)
    if leaves > MAX_INSTRUCTIONS:
        raise TooManyForms
    return among[0] if len(among) == 1 else Choice(most, tuple(among), leaves)


def scaled(form: Form, factor: Fraction) -> Form:
    """`form` times a number; the largest of some becomes the smallest where that is negative."""
    if isinstance(form, Choice):
        return Choice(form.most == (factor >= 0), tuple(scaled(each, factor) for each in form.among), form.leaves)
    return Linear({variable: term * factor for variable, term in form.terms.items()}, form.constant * factor)


def plus(left: Form, right: Form) -> Form:
    """`left + right`: a sum with the largest of some is the largest of the sums with each."""
    if isinstance(left, Choice) or isinstance(right, Choice):
        if left.leaves * right.leaves > MAX_INSTRUCTIONS:
            raise TooManyForms
        if isinstance(left, Choice):
            return choice(left.most, [plus(each, right) for each in left.among])
        assert isinstance(right, Choice)
        return choice(right.most, [plus(left, each) for each in right.among])
    terms = dict(left.terms)
    for variable, factor in right.terms.items():
        terms[variable] = terms.get(variable, Fraction(0)) + factor
    return Linear(terms, left.constant + right.constant)


def absolute(form: Form) -> Form:
    """The larger of a number and its opposite."""
    return choice(True, (form, scaled(form, Fraction(-1))))
