"""What binds once the first bottleneck is gone: a sentence, and its record."""

from collections.abc import Sequence

from busplan.buses.cycle import Term
from busplan.buses.figure import SAFE_NODES, by_key
from busplan.forms.blocks import Record, Sentence, ShownValue, count_value, joined, sentence
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import nouns
from busplan.questions.fit.bottleneck import NextBottleneck, NextLimit
from busplan.questions.fit.network import bus_of
from busplan.sections.profile import Profile


def next_bottleneck_sentence(found: NextBottleneck, profile: Profile) -> Sentence:
    """Say what binds once the largest term, or the limit of the nodes, is gone.

    Parameters
    ----------
    found
        The bottlenecks.
    profile
        The network.
    """
    term, behind = (_term(one, profile) for one in (found.binding_term, found.next_binding_term))
    term_us, behind_us, margin_us = (
        ShownValue(us, key, "us", 3)
        for us, key in (
            (found.binding_term.us, "binding_term_us"),
            (found.next_binding_term.us, "next_binding_term_us"),
            (found.next_margin_corrected_us, "next_margin_corrected_us"),
        )
    )
    if found.is_gone:
        text = f"Next bottleneck: without {term}, now {{}}, the largest term is {behind}, {{}}, and the margin {{}}"
        of_term = sentence(text, term_us, behind_us, margin_us)
    else:
        text = f"Next bottleneck: behind {term}, {{}}, which no key takes away, comes {behind}, {{}}"
        of_term = sentence(text, term_us, behind_us)
    limits = map(_limit, found.limits)
    return joined(joined(of_term, *limits, by="; "), Sentence((".",)), by="")


def _limit(found: NextLimit) -> Sentence:
    """Say what limits the nodes, or those of a group, now and next."""
    of = f" of {found.group}" if found.group else ""
    return sentence(
        f"without the limit of {found.limited_by}, now at {{}} {nouns(found.safe_nodes, 'node')}{of}, the next limit "
        f"is {found.next_limited_by}, at {{}} {nouns(found.next_safe_nodes, 'node')}",
        count_value(found.safe_nodes, SAFE_NODES.key),
        count_value(found.next_safe_nodes, "next_safe_nodes"),
    )


def _term(term: Term, profile: Profile) -> str:
    return by_key(bus_of(profile).figures.terms)[term.key].label


def next_bottleneck_record(found: NextBottleneck, profile: Profile) -> Record:
    """Of the document: what binds now and next, with the sentence that says it."""
    return {
        "binding_term": found.binding_term.name,
        "binding_term_us": found.binding_term.us,
        "next_binding_term": found.next_binding_term.name,
        "next_binding_term_us": found.next_binding_term.us,
        "next_margin_corrected_us": found.next_margin_corrected_us,
        **_limits(found.limits),
        "text": sentence_text(next_bottleneck_sentence(found, profile)),
    }


def _limits(found: Sequence[NextLimit]) -> Record:
    """What limits the nodes; of groups a list, and nothing for the whole."""
    each = [
        {
            "safe_limited_by": one.limited_by,
            "safe_nodes": one.safe_nodes,
            "next_safe_limited_by": one.next_limited_by,
            "next_safe_nodes": one.next_safe_nodes,
        }
        for one in found
    ]
    if not found[0].group:
        return each[0]
    named = [{"name": one.group, **record} for one, record in zip(found, each, strict=True)]
    return {**dict.fromkeys(each[0]), "groups": named}
