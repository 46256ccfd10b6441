"""Hashes of types of ROS 2 as REP 2016 defines them: the sha256 of the type's description as JSON. Checks those that a bridge sends."""
import hashlib
import json
import pathlib
import re

GRASP = pathlib.Path(__file__).parents[2] / "node/bridges/Grasp.msg"
# The numbers of type_description_interfaces/msg/FieldType.
NESTED, SEQUENCE = 1, 144
NUMBERS = {"uint8": 3, "int32": 6, "uint32": 7, "float64": 11, "byte": 16, "string": 17}
TYPES = {
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp, string frame_id",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Wrench": "geometry_msgs/Vector3 force, geometry_msgs/Vector3 torque",
    "geometry_msgs/msg/WrenchStamped": "std_msgs/Header header, geometry_msgs/Wrench wrench",
    "diagnostic_msgs/msg/KeyValue": "string key, string value",
    "diagnostic_msgs/msg/DiagnosticStatus": "byte level, string name, string message, string hardware_id, diagnostic_msgs/KeyValue[] values",
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header, diagnostic_msgs/DiagnosticStatus[] status",
    "tactiled_msgs/msg/Grasp": ", ".join(re.findall(r"^([\w/]+ \w+)(?= *(?:#.*)?$)", GRASP.read_text(), re.M)),
}


def fields(name):
    """Pairs of a field's description and the type that it nests, or None."""
    for text in TYPES[name].split(", "):
        kind, field = text.split()
        base = kind.removesuffix("[]")
        nested = base.replace("/", "/msg/") if "/" in base else ""
        number = NESTED if nested else NUMBERS[base]
        yield {"name": field, "type": {"type_id": number + (SEQUENCE if base != kind else 0), "capacity": 0, "string_capacity": 0,
                                       "nested_type_name": nested}}, nested


def nested_in(name):
    found = {nested for _, nested in fields(name) if nested}
    return found.union(*(nested_in(each) for each in found))


def type_hash(name):
    def description(of):
        return {"type_name": of, "fields": [field for field, _ in fields(of)]}
    whole = {"type_description": description(name), "referenced_type_descriptions": [description(of) for of in sorted(nested_in(name))]}
    return hashlib.sha256(json.dumps(whole).encode()).hexdigest()
