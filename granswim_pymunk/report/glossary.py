"""Words of the page that a reader may not know, each linked once to its meaning at the end of the page."""

from __future__ import annotations

import re
from collections.abc import Sequence

# word on the page: (how it is found, its first group is what is linked; what it means)
WORDS: dict[str, tuple[str, str]] = {
    "held out": (
        r"\b([Hh]eld[ -]out)\b",
        "Data that were not looked at before the verdict was fixed: the last part of each recording, or whole "
        "recordings. A law that is right predicts them.",
    ),
    "naive scene": (
        r"\b([Nn]aive)\b",
        "The scene as you gave it, with its own numbers. Only where and how fast the bodies start is fitted.",
    ),
    "recalibrated": (
        r"\b([Rr]ecalibrat(?:ed|ion))\b",
        "The scene with the numbers refitted that you declared adjustable, and no law added.",
    ),
    "revised": (r"\b(revised)\b", "The scene with what was found, and its numbers."),
    "noise floor": (
        r"(?:\b([Nn]oise floor)\b|times (the floor)\b)",
        "The error that noise alone leaves: of recordings simulated with the final scene and the noise of yours.",
    ),
    "rms": (r"\b(rms)\b", "Root mean square: the root of the mean of the squares."),
    "data that the fit did not see": (
        r"\b(data that the fit did not see)\b",
        "Blocks of the training part, left out of the fit one after another and predicted (cross-validation). They "
        "are not the held-out data.",
    ),
    "force without a name": (
        r"\b(force without a name)\b",
        "A smooth force that is fitted freely, as a function of speed, place, phase or time. It shows how much any "
        "force of its kind could explain; a law that explains as much leaves nothing for it.",
    ),
    "substrate": (r"\b(substrate)\b", "What a body slides on: a table, a plate."),
    "χ²": (
        r"(χ²)",
        "The misfit: seen minus predicted in standard deviations of the noise, squared and summed. Noise alone gives "
        "about 1 for each measured number.",
    ),
    "innovations": (
        r"\b([Ii]nnovations)\b",
        "Seen minus predicted, in standard deviations of the noise, in the order of time. Where nothing is missing "
        "they are like throws of a die: of size 1, and the next does not depend on the one before.",
    ),
    "z": (
        r"\((z) (?:=|over)|(?:^|\s)(z)(?= is )",
        "How many standard deviations a misfit lies above what is expected where nothing is missing. Above 5 it is no "
        "chance.",
    ),
    "p": (
        r"\((p) [≤=]|, (p)(?= (?:=|≤|&lt;) )",
        "The probability of as large a value by chance, where nothing is missing.",
    ),
    "signature": (
        r"\b(signature)\b", "What a small amount of a law changes in the tracks.",
    ),
    "central 95 %": (
        r"\b(central 95 %)|(?<=\[)(95 %)(?=:)",
        "An interval that holds the true number in 95 of 100 repeats of the experiment.",
    ),
    "d′": (
        r"(d′)",
        "How far apart two laws are expected to be after the proposed experiment, in standard errors. Below 2 it would "
        "rarely decide between them.",
    ),
    "s.d.": (r"\b(s\.d\.)", "One standard deviation."),
}  # fmt: skip
_SKIPPED = ("a", "h1", "h2", "script", "style", "code", "button", "output")
_TAG = re.compile(r"(<[^>]*>)")


def linked(parts: Sequence[str]) -> tuple[list[str], str]:
    """Parts of a page (HTML) with each word's first appearance linked, and the section that tells what they mean.

    What plays in the page stays as it is.
    """
    found: dict[str, None] = {}

    def link(text: str) -> str:
        for word, (pattern, _) in WORDS.items():
            if word in found or (match := re.search(pattern, text)) is None:
                continue
            found[word] = None
            k = next(k for k, group in enumerate(match.groups(), start=1) if group)
            before, said, after = text[: match.start(k)], match[k], text[match.end(k) :]
            # what stands before and after may hold other words
            return f'{link(before)}<a class="word" href="#{anchor(word)}">{said}</a>{link(after)}'
        return text

    done = []
    for part in parts:
        if "<script" in part:
            done.append(part)
            continue
        inside: list[str] = []
        pieces = []
        for piece in _TAG.split(part):
            if piece.startswith("<"):
                name = re.match(r"</?(\w*)", piece)
                tag = name[1].lower() if name else ""
                if tag in _SKIPPED:
                    if piece.startswith("</"):
                        inside.pop() if inside else None
                    else:
                        inside.append(tag)
                pieces.append(piece)
            else:
                pieces.append(piece if inside or not piece.strip() else link(piece))
        done.append("".join(pieces))
    told = {word: meaning for word, (_, meaning) in WORDS.items() if word in found}
    rows = "".join(f'<dt id="{anchor(word)}">{word}</dt><dd>{meaning}</dd>' for word, meaning in told.items())
    return done, f"<h2>Words</h2><dl>{rows}</dl>" if rows else ""


def anchor(word: str) -> str:
    """The id of a word's meaning."""
    names = {"χ²": "chi2", "d′": "d-prime", "central 95 %": "interval", "s.d.": "sd"}
    return "word-" + names.get(word, word.replace(" ", "-"))
