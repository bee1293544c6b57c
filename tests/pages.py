"""A page of invented records, with whatever texts a test wants in it."""

import struct
import zlib
from dataclasses import replace

from msgdrop_cli.analysis.provenance import Dropped, Maker
from msgdrop_cli.analysis.reproduction import WORDS, Decides, Line, Reading, Section
from msgdrop_cli.analysis.verdict import Word
from msgdrop_cli.definition.spec import Registration
from msgdrop_cli.definition.statements import Register, Statement
from msgdrop_cli.report.page.content import Page, Picture
from msgdrop_cli.report.table import Table

RULE = Registration(looks=(6, 10), alpha_spent=(0.02, 0.05), margin={"catches_per_500": 1.0})


def png(width: int = 2, height: int = 1, more: int = 0) -> bytes:
    """A picture of so many pixels, and so many bytes more."""

    def chunk(name: bytes, content: bytes) -> bytes:
        body = name + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    rows = chunk(b"IDAT", zlib.compress((b"\0" + b"\x80" * width) * height))
    filling = chunk(b"tEXt", b"a\0" + b"x" * more) if more else b""
    return b"\x89PNG\r\n\x1a\n" + head + filling + rows + chunk(b"IEND", b"")


def reading(word: Word, *readings: str) -> Reading:
    """A claim under some readings."""
    return Reading(
        readings=readings,
        environment="pursuit-n6",
        profile="quick",
        train_env_steps=100_000,
        word=word,
        reason="first registered look at 6 seeds",
        difference=2.5,
        low=1.0,
        high=4.0,
        seeds=3,
        lost=1,
        evidence=None,
        is_judged=False,
        prospect=None,
        unforeseen="",
        margin=1.0,
        runs=("01234567",),
    )


def line(number: int, word: Word, text: str = "Dropout helps") -> Line:
    """A claim with this word."""
    found = (reading(word, *(["nearest"] if word == "contradicted" else [])),)
    return Line(
        key=f"figure-6-{number}",
        question="broken-links",
        says=f"{text} no. {number}",
        source="l. 528",
        papers=True,
        better="md-0.2",
        worse="dcc",
        better_label=f"{text} MD",
        worse_label=f"{text} DCC",
        environment="pursuit-n6",
        metric="catches_per_500",
        measure="evaluation",
        channel="half broken",
        word=word,
        told_by=None if word in ("not run", "under-specified") else 0,
        readings=() if word == "not run" else found,
        command=f"msgdrop ablate broken-links --seeds {number}",
        decides=Decides(
            seeds=6, forecast=False, registered=True, runs=6, seconds=300.0, source="measured"
        ),
    )


def page(text: str = "Dropout helps", words: tuple[Word, ...] = ()) -> Page:
    """A page of one section, a claim for each word; text: stands wherever texts stand."""
    words = words or WORDS
    section = Section(
        key="figure-6",
        title=f"Figure 6: {text}",
        question="broken-links",
        asks=text,
        source=text,
        registered=f"broken-links:{text}",
        registration=RULE,
        measures=("evaluation",),
        environments=("pursuit-n6",),
        lines=tuple(line(number, word, text) for number, word in enumerate(words, start=1)),
    )
    shown = Table(title=text, headers=("a", text), rows=(("b", text),), caption=text)
    statement = Statement(
        chapter=text,
        says=text,
        read_as=f"{text} (ours); reading `huber`",
        code=text,
        tests=text,
        if_wrong=text,
        readings=("huber",),
    )
    maker = Maker(
        host=text,
        device="cpu",
        kernel=text,
        torch="2",
        commits=("0123456",),
        runs=6,
        env_steps=600_000,
        hours=0.5,
    )
    return Page(
        sections=(section, replace(section, key="figure-7", lines=(line(8, "supported", text),))),
        pictures={"figure-6": (Picture("learning", text, png()), Picture("bars", text, png()))},
        tables={"figure-6": (shown,)},
        register=Register(statements=(statement,), unclaimed=((text, "no claim"),)),
        readings={"huber": text},
        makers=(maker,),
        dropped=(Dropped(what="failed", name=text, runs=1, reason=text),),
        altered=(text,),
        folder=text,
        origin=text,
        version="1",
        commit=None,
    )
