"""Formats of recorded flights, by the ending of the file."""

from pathlib import Path

from dyknow.model.errors import TextError
from dyknow.proxies.recordings.dataflash import DataflashRecording
from dyknow.proxies.recordings.mcap_log import JournalRecording
from dyknow.proxies.recordings.recording import Recording
from dyknow.proxies.recordings.tlog import TelemetryRecording
from dyknow.proxies.recordings.ulog import UlogRecording

FORMATS: dict[str, type[TelemetryRecording | DataflashRecording | UlogRecording | JournalRecording]] = {
    ".tlog": TelemetryRecording,
    ".bin": DataflashRecording,
    ".ulg": UlogRecording,
    ".mcap": JournalRecording,
}


def open_recording(path: str | Path) -> Recording:
    """Open the recording in a .tlog, .bin (ArduPilot dataflash), .ulg (PX4) or .mcap (journal of a node) file.

    Raises:
        TextError: no such file, or an ending that is none of these.
        DecodeError: not a file of its kind, or without any position.
    """
    found = Path(path)
    kind = FORMATS.get(found.suffix.lower())
    if kind is None:
        raise TextError("a recording ends in .tlog, .bin, .ulg or .mcap", text=str(path), repair="flight.tlog")
    if not found.is_file():
        raise TextError("there is no such recording", text=str(path))
    recording = kind(found)
    _ = recording.first_position_us
    return recording
