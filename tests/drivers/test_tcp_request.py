"""One request over TCP: answered, cut off, unanswered, refused."""

from __future__ import annotations

import socket
import threading

import pytest

from drivers.errors import LinkError
from drivers.tcp_request import send_request


def served(*pieces: bytes, stay: bool = False) -> tuple[str, int]:
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with server, server.accept()[0] as peer:
            assert peer.recv(100) == b"question"
            for piece in pieces:
                peer.sendall(piece)
            if stay:
                peer.recv(1)

    threading.Thread(target=serve, daemon=True).start()
    return server.getsockname()[:2]  # type: ignore[no-any-return]


def test_an_answer_in_parts_is_one() -> None:
    assert send_request("load cell", *served(b"ans", b"wer"), b"question", 6, 5.0) == b"answer"


def test_a_partial_answer_is_an_error() -> None:
    host, port = served(b"ans")
    with pytest.raises(LinkError, match=f"^load cell at {host}:{port}: hung up after 3 of 6 bytes"):
        send_request("load cell", host, port, b"question", 6, 5.0)


def test_silence_is_reported_with_its_timeout() -> None:
    with pytest.raises(LinkError, match=r"no answer in 0\.1 s"):
        send_request("load cell", *served(b"ans", stay=True), b"question", 6, 0.1)


@pytest.mark.parametrize("port", [1, 70000])
def test_a_refused_connection_is_reported(port: int) -> None:
    with pytest.raises(LinkError, match=f"^load cell at 127.0.0.1:{port}: "):
        send_request("load cell", "127.0.0.1", port, b"question", 6, 1.0)
