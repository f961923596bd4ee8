"""Every error that a caller of ours can cause, in one small tree.

What comes from a wire never raises: it is counted, reported and dropped by the decoders.
"""


class ChuteError(Exception):
    """Root of all errors of this package."""


class ParameterError(ChuteError, ValueError):
    """A parameter has a value that is not allowed. The text names it, the value and the fix."""


class MessageError(ChuteError, ValueError):
    """A message to be sent holds a value that its field cannot carry."""


class TransitionError(ChuteError):
    """A state machine was given an event that its table does not list for its state."""


class SigningKeyError(ChuteError, ValueError):
    """A signing key cannot be used. The text names the file and the fix."""


class NotBuiltError(ChuteError, ImportError):
    """A generated part is missing. The text says which command makes it."""


class RecordError(ChuteError, ValueError):
    """A recording of the supervisor cannot be read. The text says what does not fit."""


class ProfileError(ChuteError, ValueError):
    """A profile of rules, or the description of a vehicle, is not right. The text lists each
    mistake with its line and the fix."""


class CampaignError(ChuteError):
    """What flies a campaign cannot begin, or ended by itself. The text says why, and the fix."""


class NameTakenError(ChuteError):
    """Another living supervisor has this name. The text says which, and the fix."""


class NotRegisteredError(ChuteError):
    """A link is not registered as it should be. The text names the entry and what it needs."""
