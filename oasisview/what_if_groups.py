"""What applying a what-if says about identities and labels, as groups of fragments for one journal entry."""

from __future__ import annotations

from collections.abc import Collection

from oasisview.review import Fragment, Group
from pipeline.change.relabel import Relabelled


def what_if_groups(relabelled: Relabelled, decided: Collection[Fragment]) -> list[Group]:
    """What would be otherwise, all of it but what people decided about.

    An object of which any part was decided stays as it is, and so does what would become one with it: half
    of a change of identity would be a state that nobody asked for.
    """
    groups = _groups(relabelled)
    kept = {fragment.object_id for fragment in decided}
    while True:
        touched = {f.object_id for group in groups for f in group.members if _meets(group, kept)}
        if touched <= kept:
            return [group for group in groups if not _meets(group, kept)]
        kept |= touched


def _groups(relabelled: Relabelled) -> list[Group]:
    flipped = {flip.object_id for flip in relabelled.flips}
    before, after = relabelled.by_visit
    joined = {row for row, _ in relabelled.pairs}, {column for _, column in relabelled.pairs}
    groups = [
        Group(frozenset({Fragment(row, 0), Fragment(column, 1)}), before[row])
        for row, column in sorted(relabelled.pairs)
        if row in flipped or column in flipped
    ]
    for session, labels in enumerate((before, after)):
        groups += [
            Group(frozenset({Fragment(object_id, session)}), labels[object_id])
            for object_id in sorted(flipped & labels.keys() - joined[session])
        ]
    return groups


def _meets(group: Group, object_ids: Collection[int]) -> bool:
    return any(fragment.object_id in object_ids for fragment in group.members)
