"""What is known of a valve, kept over restarts of the daemon: identification, static law, landings, margins.

`StoredMemory.in_folder` reads at the start what was kept; `MemoryKeeper` writes it from a thread of its own. Whether it
is still true, the control core finds out (`positioner.control.restored_knowledge`).

    memory_file                   the file: version, checksum, written whole; what cannot be used is set aside
    knowledge_record              what is known as JSON, and back, checked
    known_configuration           for which configuration it holds, and which key has changed
    memory_keeper                 when it is written
"""

from positioner.daemon.memory.memory_keeper import MemoryKeeper, StoredMemory

__all__ = ["MemoryKeeper", "StoredMemory"]
