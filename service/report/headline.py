"""The verdict in a sentence or two."""

from __future__ import annotations

from typing import Any

from service.report.plots import words
from service.report.svg import number


def headline(content: dict[str, Any]) -> str:
    """Say what was found, and whether a recording not used in the fit agrees.

    Args:
        content: ``diagnosis.json``.

    Returns:
        Plain text.
    """
    since = [item for item in content["findings"] if "since the reference" in item["where"]["region"]]
    names = [_named(item) for item in content["findings"] if item not in since]
    if content["verdict"] == "consistent":
        text = f"The model of {content['robot']} explains this recording down to its noise."
        if content.get("lack_of_fit", {}).get("p") is None:
            text += " The run does not repeat, so small misfits cannot be told from noise."
        return text + " What such a recording could not have shown stands under Blind spots."
    if since:
        return " ".join(item["sentence"] for item in since) + _beside(content, names)
    if not names:
        return "The model does not explain this recording, and no effect of the catalogue does: see what is left and where."
    text = f"{_list(names)} {'explains' if len(names) == 1 else 'explain'} what the model lacks"
    text += (
        ", but something without a name is left." if content["unexplained"] else _left(content)
    )
    return text + _gain(content)


def _left(content: dict[str, Any]) -> str:
    if content.get("lack_of_fit", {}).get("p") is None:
        return "; the run does not repeat, so what is left cannot be told from noise."
    return "; what is left is noise."


def _beside(content: dict[str, Any], names: list[str]) -> str:
    """What a run with changes since its reference shows besides them."""
    text = f" Besides: {_list(names)}." if names else ""
    return text + (" Something without a name is left." if content["unexplained"] else "")


def _named(item: dict[str, Any]) -> str:
    name = words(item["effect"])
    place = item["joint"] or item["channel"]
    named = f"{name} in {words(place)}" if place else name
    return (
        named[0].upper() + named[1:]
        if not item["alternatives"]
        else f"{named[0].upper()}{named[1:]} (or a look-alike)"
    )


def _list(names: list[str]) -> str:
    if len(names) == 1:
        return names[0]
    tail = [name[0].lower() + name[1:] for name in names[1:]]
    return ", ".join([names[0], *tail[:-1]]) + " and " + tail[-1]


def _gain(content: dict[str, Any]) -> str:
    """The largest proven gain on the held-out recording."""
    held = content["fit"]["validation"]
    intervals = held.get("gain_interval", {})
    proven = [c for c, (low, _) in ((c, v) for c, v in intervals.items() if None not in v) if low > 0]
    if held.get("rejected") and not held["before"]:
        return " The held-out recording could not serve as proof: see Before and after."
    if not held["before"]:
        return " No held-out recording was given to prove it on."
    if not proven:
        return " The held-out recording shows no proven gain."
    channel = max(
        proven, key=lambda c: (held["before"][c] - held["after"][c]) / max(held["noise"][c] or 0.0, 1e-300)
    )
    unit = "N" if channel.startswith("force") else "N.m"
    return (
        f" On a recording not used in the fit the error of {words(channel)} falls from {number(held['before'][channel])} to "
        f"{number(held['after'][channel])} {unit} (noise {number(held['noise'][channel])})."
    )
