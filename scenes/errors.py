"""The one error of scenes whose text is meant for a person."""


class SceneError(ValueError):
    """A scene that cannot be built. The message is one sentence meant for its author."""
