"""Records as a node would, as fast as topics come, until it is killed: `... DIRECTORY`.

Prints the stamp of each message once it was handed to the recorder.
"""

import sys
import time
from pathlib import Path

from rope_twin.messages import encode_heave
from rope_twin.recording.bag_writer import BagRecorder
from rope_twin.topics import BY_NAME

recorder = BagRecorder(Path(sys.argv[1]), [BY_NAME["ship/heave"]], {"source": "a test"})
while True:
    now_ns = time.time_ns()
    recorder.write("ship/heave", now_ns, encode_heave(now_ns, 0.0, 0.0))
    print(now_ns, flush=True)
    time.sleep(0.01)
