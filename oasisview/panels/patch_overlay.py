"""Patch matches over the two pictures of the band: marks in both, words below; links.js draws the lines.

Confidence is told by colour (cividis, dark = low) and, below the limit of a sure match, by dashes.
"""

from __future__ import annotations

from dataclasses import dataclass

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import link_colour
from oasisview.panels.markup import sends
from oasisview.patch_links import DrawnLink, PatchPick, PatchStory, links_of_object, story_of
from oasisview.shell import escape


@dataclass(frozen=True)
class PatchOverlay:
    """What is drawn over a pair of pictures.

    Attributes:
        pick, story: the patch that was clicked and what is known of it; None without one.
        links: further matches, of the selected object.
        tau_s: quality from which a match is sure.
        note: why there is nothing to draw, if so.
    """

    tau_s: float
    pick: PatchPick | None = None
    story: PatchStory | None = None
    links: tuple[DrawnLink, ...] = ()
    note: str = ""

    def marks(self, session: int) -> str:
        """Marks in the picture of a visit, over a 100 x 100 view box; ends of a line carry one number."""
        drawn = "".join(
            _mark(number, link, session, self.tau_s)
            for number, link in reversed(list(enumerate(self._all())))
        )
        if self.story is not None and self.pick is not None and self.pick.session == session:
            x, y = (self.story.match.before, self.story.match.after)[session]
            width, height = self.story.size
            drawn += (
                f'<rect class="oa-patch" x="{100 * (x - width / 2):.2f}" y="{100 * (y - height / 2):.2f}" '
                f'width="{100 * width:.2f}" height="{100 * height:.2f}"/>'
            )
        return f'<svg class="oa-patches" viewBox="0 0 100 100" preserveAspectRatio="none">{drawn}</svg>'

    def words(self) -> str:
        """What the picked patch says; empty without one."""
        if self.story is not None:
            text = patch_words(self.story, self.tau_s)
        elif self.note:
            text = self.note
        else:
            return ""
        return (
            f'<div class="oa-patch-words" role="status"><span title="{escape(text)}">{escape(text)}</span>'
            f'<button {sends("patch_clear")} title="Hide the match" aria-label="Hide the match">'
            "\u00d7</button></div>"
        )

    def _all(self) -> tuple[DrawnLink, ...]:
        if self.story is None:
            return self.links
        return (self.story.match, *self.story.rivals, *self.links)


def patch_overlay(
    catalogue: Catalogue, pair: tuple[int, int], pick: PatchPick | None, of_object: int | None
) -> PatchOverlay:
    """What to draw over a pair of keyframes (earlier, later).

    Args:
        pick: a patch; one of another pair is not shown.
        of_object: the object whose matches are shown too.
    """
    tau_s = catalogue.limits.tau_s
    pick = pick if pick is not None and pick.pair == pair else None
    if pick is None and of_object is None:
        return PatchOverlay(tau_s)
    links = catalogue.result.links(*pair)
    if links is None:
        return PatchOverlay(tau_s, note=wording.NOT_COMPARED)
    story = story_of(links, pick.session, pick.u, pick.v) if pick is not None else None
    drawn: tuple[DrawnLink, ...] = ()
    if of_object is not None:
        masks = [catalogue.mask(session, keyframe) == of_object for session, keyframe in enumerate(pair)]
        drawn = links_of_object(links, masks[0], masks[1])
    return PatchOverlay(tau_s, pick, story, drawn)


def patch_words(story: PatchStory, tau_s: float) -> str:
    """What is known of a patch, in words."""
    score = story.match.score
    sure = "sure" if score >= tau_s else f"below {tau_s:.2f}"
    said = f"Best match {score:.2f} ({sure})"
    if story.mutual:
        said += ", mutual"
    elif story.prefers is not None:
        said += f"; that one prefers another ({story.prefers:.2f})"
    count = len(story.rivals)
    if count:
        best = story.rivals[0].score
        said += (
            f". {count} rival{'' if count == 1 else 's'} claim{'s' if count == 1 else ''} it too ({best:.2f})"
        )
    else:
        said += ". No rival"
    return said + "."


def _mark(number: int, link: DrawnLink, session: int, tau_s: float) -> str:
    x, y = (link.before, link.after)[session]
    end = ("from", "to")[session]
    colour = link_colour(link.score)
    dashed = "" if link.score >= tau_s else " oa-weak"
    words = f"{wording.LINK_ROLES[link.role]}, quality {link.score:.2f}"
    # A line of no length with round ends is a dot that the stretched view box leaves round.
    return (
        f'<path class="oa-end oa-{link.role}{dashed}" data-link-{end}="{number}" style="--s:{colour}" '
        f'd="M{100 * x:.2f} {100 * y:.2f}h0.01"><title>{escape(words)}</title></path>'
    )
