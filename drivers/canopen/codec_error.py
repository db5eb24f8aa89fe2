"""The error of the CANopen codecs, which identifies a frame by its COB-ID."""

from drivers import errors


class CodecError(errors.CodecError):
    """A frame that cannot be decoded or encoded; names its COB-ID, expected and received values."""

    def __init__(self, cob_id: int, expected: str, got: str) -> None:
        super().__init__(f"frame {cob_id:#05x}", "", expected, got)
        self.cob_id = cob_id


def wrong_length(cob_id: int, expected: int, got: int) -> CodecError:
    """Return the error for a frame with a wrong number of data bytes."""
    return CodecError(cob_id, f"{expected} bytes", f"{got} bytes")
