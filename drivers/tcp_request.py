"""One question over TCP before a run, as for a calibration: asked, answered, hung up. It waits."""

import socket

from drivers.errors import LinkError


def ask(device: str, host: str, port: int, request: bytes, size: int, timeout: float) -> bytes:
    """The ``size`` bytes of the answer; LinkError if they have not come ``timeout`` s after a part.

    Never from a loop: it blocks.
    """
    where = f"{device} at {host}:{port}"
    answer = b""
    try:
        with socket.create_connection((host, port), timeout) as peer:
            peer.sendall(request)
            while len(answer) < size:
                piece = peer.recv(size - len(answer))
                if not piece:
                    raise LinkError(f"{where}: hung up after {len(answer)} of {size} bytes")
                answer += piece
    except TimeoutError as error:
        raise LinkError(f"{where}: no answer in {timeout:g} s") from error
    except LinkError:
        raise
    except (OSError, OverflowError) as error:
        raise LinkError(f"{where}: {error}") from error
    return answer
