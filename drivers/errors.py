"""The errors of all drivers.

`CodecError` is for invalid data, `LinkError` for a failed wire, `ServiceError` for a device that
cannot be set up.
"""


class CodecError(ValueError):
    """Bytes that are not a valid message, or a value that no message can carry.

    A decoder raises no other error, whatever its input. The attributes are the message
    (``subject``), the invalid part of it (``field``), what was expected there and what was found.
    """

    def __init__(self, subject: str, field: str, expected: str, got: object) -> None:
        super().__init__(
            ": ".join(filter(None, (subject, field, f"expected {expected}, got {got}")))
        )
        self.subject = subject
        self.field = field
        self.expected = expected
        self.got = got


class LinkError(OSError):
    """A wire that cannot be opened, is lost or does not answer; names device, port and cause.

    Links and lines raise this error or a subclass of it, and nothing else.
    """


class ServiceError(OSError):
    """A device of a bus that cannot be set up or homed; names device and reason."""
