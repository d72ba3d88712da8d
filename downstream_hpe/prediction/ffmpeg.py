# SPDX-License-Identifier: MIT
"""PyAV, which has FFmpeg inside, and what of FFmpeg may be used."""

from __future__ import annotations

import socket
from typing import Any
from urllib.parse import urlsplit

from downstream_hpe.errors import ModelError

FORMATS = (
    "mov,mp4,matroska,webm,avi,asf,flv,live_flv,mpeg,mpegts,mpegvideo,m4v,h264,hevc,vvc,obu,av1,mjpeg,mpjpeg,"
    "ogg,mxf,dv,ivf,yuv4mpegpipe,rm,wtv"
)
"""Demultiplexers that may read what a stranger gives: none is a list of other files or of addresses."""
FORMATS_OF_ADDRESSES = f"{FORMATS},rtsp,rtp,hls,jpeg_pipe,png_pipe,webp_pipe"
"""And of an address: what it leads to may name other addresses, and never a file of this machine."""
PROTOCOLS_OF_ADDRESSES = "http,https,httpproxy,tcp,tls,udp,rtp,rtsp,rtmp,rtmps,rtmpt,ffrtmphttp,crypto"


def ffmpeg() -> Any:
    """The module av. ModelError: it is not installed."""
    try:
        import av
    except ImportError as error:
        raise ModelError("PyAV, which reads videos, is not installed: pip install av") from error
    return av


def reason(error: Exception) -> str:
    """What went wrong, in FFmpeg's words, without the address, which may hold a password."""
    said = str(getattr(error, "strerror", None) or type(error).__name__)
    return "the connection ended" if said == "Input/output error" else said


def known_host(address: str) -> bool:
    """Whether the host of an address has an address of its own, which FFmpeg does not tell."""
    try:
        socket.getaddrinfo(urlsplit(address).hostname, None)
    except (OSError, UnicodeError, ValueError):
        return False
    return True
