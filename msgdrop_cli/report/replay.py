"""An episode as a page, a moving picture or a film; each is one file that needs nothing else."""

import json
import shutil
import subprocess
from contextlib import suppress
from importlib import resources
from io import BytesIO
from typing import Any

import msgdrop_cli.report
from msgdrop_cli.definition.strict import one_line
from msgdrop_cli.errors import DefinitionError, RunError, to_install
from msgdrop_cli.signals import scratch_folder

_SIDE, _STRIP = 360, 16
"""Pixels of the moving picture, and of the line of words below it."""
_SLOWEST_MS, _FASTEST_MS, _LONGEST_MS = 100, 20, 20_000
"""Of a frame, and of the whole: a long episode is shown faster."""
_SMALLEST = 0.008
"""Radius, as a part of the side, that everything has at least."""
_BACKGROUND, _WORDS = (250, 250, 247), (70, 70, 74)
_WORKS, _BROKEN = (178, 178, 174), (190, 30, 45)


def page(episode: Any) -> bytes:
    """A page with a slider; episode: an `engine.episode.Episode`.

    Agents can be clicked: then only their links are shown.
    """
    frames = [
        {
            "discs": [
                [round(d.x, 4), round(d.y, 4), round(d.radius, 4), list(d.colour), d.label]
                for d in frame.discs
            ],
            "links": [[link.first, link.second, int(link.works)] for link in frame.links],
            "lost": frame.lost,
            "score": [round(value, 4) for _, value in frame.score],
        }
        for frame in episode.frames
    ]
    first = episode.frames[0]
    kinds = {d.kind: list(d.colour) for frame in episode.frames for d in frame.discs if d.kind}
    data = {
        "title": episode.title,
        "agents": list(episode.agents),
        "said": first.said,
        "score": [name.replace("_", " ") for name, _ in first.score],
        "kinds": list(kinds.items()),
        "outcome": episode.outcome,
        "frames": frames,
    }
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = (resources.files(msgdrop_cli.report) / "replay.html").read_text("utf-8")
    return template.replace("EPISODE", text, 1).encode()


def moving_picture(episode: Any) -> bytes:
    """A GIF that shows every step; episode: an `engine.episode.Episode`. Loads pillow."""
    images = [_drawn(episode, number) for number in range(len(episode.frames))]
    each = _milliseconds(episode)
    content = BytesIO()
    whole = {"save_all": True, "append_images": images[1:], "loop": 0, "optimize": False}
    images[0].save(content, "GIF", duration=each // 10 * 10, **whole)  # it counts hundredths
    return content.getvalue()


def film(episode: Any) -> bytes:
    """An MP4 that shows every step; episode: an `engine.episode.Episode`. Loads pillow.

    Raises DefinitionError: there is no ffmpeg, which draws it; RunError, what ffmpeg says.
    """
    first = _drawn(episode, 0)
    size, each = f"{first.width}x{first.height}", _milliseconds(episode)
    with scratch_folder() as folder:
        file = folder / "film.mp4"
        raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{1000 / each}", "-i", "-")
        kind = ("-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart")
        with subprocess.Popen(
            [_ffmpeg(), "-v", "error", *raw, *kind, str(file)],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as process:
            assert process.stdin
            assert process.stderr
            with suppress(BrokenPipeError):
                for number in range(len(episode.frames)):
                    process.stdin.write(_drawn(episode, number).convert("RGB").tobytes())
                process.stdin.close()
            said = process.stderr.read().decode(errors="replace")
        if process.returncode:
            raise RunError(f"ffmpeg: {one_line(said) or process.returncode}; --gif needs none")
        return file.read_bytes()


def _ffmpeg() -> str:
    """The machine's own, or the one that imageio-ffmpeg brings along."""
    if own := shutil.which("ffmpeg"):
        return own
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        theirs: str = get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        hint = f"--gif needs none; install it, or {to_install('video')}"
        raise DefinitionError(f"--mp4: there is no ffmpeg; {hint}") from None
    return theirs


def _milliseconds(episode: Any) -> int:
    """How long a frame is shown."""
    return max(_FASTEST_MS, min(_SLOWEST_MS, _LONGEST_MS // len(episode.frames)))


def _drawn(episode: Any, number: int) -> Any:
    from PIL import Image, ImageDraw

    frame = episode.frames[number]
    image = Image.new("RGB", (_SIDE, _SIDE + _STRIP), _BACKGROUND)
    draw = ImageDraw.Draw(image)
    agents, others = frame.discs[: len(episode.agents)], frame.discs[len(episode.agents) :]
    for disc in others:
        _disc(draw, disc)
    for link in sorted(frame.links, key=lambda link: not link.works):
        ends = [(agents[end].x * _SIDE, agents[end].y * _SIDE) for end in link[:2]]
        draw.line(ends, fill=_WORKS if link.works else _BROKEN, width=1)
    for disc in agents:
        _disc(draw, disc)
    words = f"step {number + 1} of {len(episode.frames)}, messages lost: {frame.lost}"
    draw.rectangle((0, _SIDE, _SIDE, _SIDE + _STRIP), fill=_BACKGROUND)
    draw.text((4, _SIDE + 2), words, fill=_WORDS)
    return image.quantize(32, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)


def _disc(draw: Any, disc: Any) -> None:
    x, y, radius = (each * _SIDE for each in (disc.x, disc.y, max(disc.radius, _SMALLEST)))
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=disc.colour)
    if disc.label:
        draw.text((x, y), disc.label, fill=(255, 255, 255), anchor="mm")
