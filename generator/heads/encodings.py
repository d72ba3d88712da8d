# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of programs that write in their machine's own encoding, and the spellings one file name may have."""

from __future__ import annotations

import unicodedata

_CHINESE, _PLAIN_CHINESE, _WESTERN = "gb18030", "gb2312", "latin-1"


def local_text(data: bytes) -> str:
    """Text that is not UTF-8: Chinese where it reads as such throughout, else Western European."""
    try:
        text = data.decode(_CHINESE)
    except UnicodeDecodeError:
        return data.decode(_WESTERN)
    beyond_ascii = [character for character in text if not character.isascii()]
    # Any two accented letters make a rare character; what is written is mostly made of common ones.
    common = sum(_is_plain(character) for character in beyond_ascii)
    return text if 2 * common >= len(beyond_ascii) else data.decode(_WESTERN)


def _is_plain(character: str) -> bool:
    try:
        character.encode(_PLAIN_CHINESE)
    except UnicodeEncodeError:
        return False
    return True


def spellings(name: str) -> set[str]:
    """What a file of that name may be called: composed or not, in either case, misread."""
    names = {name}
    for written, meant in ((_CHINESE, _WESTERN), (_WESTERN, _CHINESE)):
        try:
            names.add(name.encode(written).decode(meant))
        except UnicodeError:
            continue
    return {_folded(spelling) for spelling in names}


def is_spelled(name: str, wanted: set[str]) -> bool:
    """Is a name one of :func:`spellings`?"""
    return _folded(name) in wanted


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())
