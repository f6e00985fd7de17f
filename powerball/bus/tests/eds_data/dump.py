"""What python-canopen reads of the EDS files of this folder, as JSON next to them.

    pip install canopen==2.4.1 && python dump.py

sample.eds and datatypes.eds are python-canopen's own (test/ of version 2.4.1, https://github.com/canopen-python/canopen),
under the licence in LICENSE; compact.eds, node.eds and canfestival.eds are ours. Not dumped: what python-canopen makes of
[DummyUsage], which are types and no objects, and parts of arrays that no section names. Numbers are those of the node that
the file commissions, or of node 5. Empty text is no value.
"""

import json
import pathlib

import canopen
from canopen.objectdictionary import ODVariable

NODE = 5


def plain(value):
    """A value without an empty one: bytes as hexadecimal text."""
    if isinstance(value, bytes):
        value = value.hex()
    return None if value == "" else value


def row(variable):
    return {
        "index": variable.index,
        "sub": variable.subindex,
        "name": variable.name,
        "data_type": variable.data_type,
        "access": variable.access_type,
        "mappable": variable.pdo_mappable,
        "default": plain(variable.default),
        "value": plain(variable.value),
    }


def rows(dictionary):
    for index in sorted(dictionary):
        entry = dictionary[index]
        if index < 0x20:
            continue
        if isinstance(entry, ODVariable):
            yield row(entry)
        else:
            yield from (row(entry.subindices[sub]) for sub in sorted(entry.subindices))


for path in sorted(pathlib.Path(__file__).parent.glob("*.eds")):
    commissioned = canopen.import_od(str(path))
    node = commissioned.node_id or NODE
    dictionary = canopen.import_od(str(path), node_id=node)
    read = {
        "node": commissioned.node_id,
        "bitrate": commissioned.bitrate,
        "evaluated_for": node,
        "objects": list(rows(dictionary)),
    }
    path.with_suffix(".json").write_text(json.dumps(read, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(path.name, len(read["objects"]))
