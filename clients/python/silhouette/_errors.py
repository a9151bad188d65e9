# SPDX-License-Identifier: Apache-2.0
"""Errors of calls: one sentence each that names the server and the mend. No error is a verdict."""


class Error(Exception):
    """Any error of a call to silhouette-server."""


class Unavailable(Error, ConnectionError):
    """No server answers there, or it went away before the answer was complete."""


class DeadlineExceeded(Error, TimeoutError):
    """The server did not answer in time."""


class InvalidArgument(Error, ValueError):
    """The server or this library refuses the request."""


class NotFound(Error, LookupError):
    """The server does not have it."""


class FailedPrecondition(Error):
    """The server cannot do this as it is set up."""


class Aborted(Error):
    """The database was replaced meanwhile: publish or allow again."""


class PermissionDenied(Error, PermissionError):
    """The server's roles do not allow this client the call."""


class ResourceExhausted(Error):
    """The request or the answer is too large, or there are too many at once."""


class OutOfRange(Error):
    """The end was reached."""


class Unimplemented(Error, NotImplementedError):
    """The server is older than this library."""


class Internal(Error):
    """The answer is malformed."""


class Cancelled(Error):
    """The call was cancelled."""
