"""One blocking request over TCP before a run, for example for a calibration."""

import socket

from drivers.errors import LinkError


def send_request(
    device: str, host: str, port: int, request: bytes, size: int, timeout: float
) -> bytes:
    """Send a request and return the ``size`` bytes of its answer.

    The call blocks, so never use it in a loop. LinkError if the connection fails or ends early, or
    if no part of the answer arrives for ``timeout`` s.
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
