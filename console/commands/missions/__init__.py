"""Commands about missions: have one flown, follow it, answer its questions, end it.

Each is a speech act to the platform that leads the mission, which continues when the command ends. Programs do the same
by `dyknow.runtime.library.missions`.
"""
