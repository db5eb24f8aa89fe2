"""The two errors of all drivers: what was said makes no sense, or the wire is not there."""


class CodecError(ValueError):
    """Bytes that are not a message, or a value that no message can carry.

    Nothing else leaves a decoder, whatever bytes go in. The four fields say what was read or
    written, where in it the trouble lies, what was expected there and what stood there instead.
    """

    def __init__(self, what: str, where: str, expected: str, got: object) -> None:
        super().__init__(": ".join(filter(None, (what, where, f"expected {expected}, got {got}"))))
        self.what = what
        self.where = where
        self.expected = expected
        self.got = got


class LinkError(OSError):
    """A wire that cannot be opened, is gone or stays silent; names device, port and what happened.

    What a link or a line raises is this or a kind of it, and nothing else.
    """
