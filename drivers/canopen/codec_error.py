"""The error of this folder's codecs: a frame is named by its COB-ID."""

from drivers import errors


class CodecError(errors.CodecError):
    """A frame that cannot be read or built; names its COB-ID, what was expected and what came."""

    def __init__(self, cob_id: int, expected: str, got: str) -> None:
        super().__init__(f"frame {cob_id:#05x}", "", expected, got)
        self.cob_id = cob_id


def wrong_length(cob_id: int, expected: int, got: int) -> CodecError:
    """The error for a frame with another number of data bytes than agreed."""
    return CodecError(cob_id, f"{expected} bytes", f"{got} bytes")
