"""Small motion files, built as text: a person in inches, centimetres or Acclaim's units."""

ASF = """# a comment
:version 1.10
:name SMALL
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   nothing to say
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 0 -1 0
     length 2
     axis 0 0 0 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name shank
     direction 0 -1 0
     length 1
     axis 0 0 90 XYZ
    dof rx
    limits (-10.0 170.0)
  end
  begin
     id 3
     name foot
     direction 0 0 1
     length 0.5
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh
    thigh shank
    shank foot
  end
"""

AMC = """#!OML:ASF C:\\small.asf
:FULLY-SPECIFIED
:DEGREES
1
root 0 3 0 0 0 0
thigh 90 0 0
shank 0
2
root 1 3 0 0 90 0
thigh 0 0 0
shank 90
3
root 2 3 0 0 0 0
thigh 0 0 1.5e-015
shank -90.25
"""

BVH = """HIERARCHY
ROOT hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -2 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -1 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 3 0 0 0 0 0 0 0
1 3 0 90 0 0 0 90 0
2 3 0 0 -0 0 1.5e-015 0 -90.25
"""

# name, parent, offset in centimetres: arms stretched out, bones along the axes, as HumanIK rigs
PERSON = (
    ("Hips", "", (0, 95, 0)),
    ("LeftUpLeg", "Hips", (9, 0, 0)), ("LeftLeg", "LeftUpLeg", (0, -43, 0)),
    ("LeftFoot", "LeftLeg", (0, -42, 0)), ("LeftToeBase", "LeftFoot", (0, -8, 14)),
    ("RightUpLeg", "Hips", (-9, 0, 0)), ("RightLeg", "RightUpLeg", (0, -43, 0)),
    ("RightFoot", "RightLeg", (0, -42, 0)), ("RightToeBase", "RightFoot", (0, -8, 14)),
    ("Spine", "Hips", (0, 15, 0)), ("Spine1", "Spine", (0, 15, 0)), ("Neck", "Spine1", (0, 20, 0)),
    ("Head", "Neck", (0, 10, 0)), ("Head/End", "Head", (0, 15, 0)),
    ("LeftShoulder", "Spine1", (4, 16, 0)), ("LeftArm", "LeftShoulder", (13, 0, 0)),
    ("LeftForeArm", "LeftArm", (28, 0, 0)), ("LeftHand", "LeftForeArm", (25, 0, 0)),
    ("RightShoulder", "Spine1", (-4, 16, 0)), ("RightArm", "RightShoulder", (-13, 0, 0)),
    ("RightForeArm", "RightArm", (-28, 0, 0)), ("RightHand", "RightForeArm", (-25, 0, 0)),
)  # fmt: skip


def bvh_text(nodes, rows, frame_time="0.0333333", channels="Zrotation Xrotation Yrotation"):
    """Write a BVH of `nodes` (name, parent, offset); the root has positions before `channels`."""
    children = {}
    for node in nodes:
        children.setdefault(node[1], []).append(node)

    def lines(node, depth):
        name, parent, offset = node
        end = name.endswith("/End")
        kind = "End Site" if end else f"{'JOINT' if parent else 'ROOT'} {name}"
        yield "\t" * depth + kind
        yield "\t" * depth + "{"
        yield "\t" * (depth + 1) + "OFFSET {} {} {}".format(*offset)
        if not end:
            kinds = channels if parent else f"Xposition Yposition Zposition {channels}"
            yield "\t" * (depth + 1) + f"CHANNELS {len(kinds.split())} {kinds}"
        for child in children.get(name, ()):
            yield from lines(child, depth + 1)
        yield "\t" * depth + "}"

    text = ["HIERARCHY", *lines(children[""][0], 0), "MOTION", f"Frames: {len(rows)}"]
    text.append(f"Frame Time: {frame_time}")
    text += [" ".join(format(v, "g") for v in row) for row in rows]
    return "\n".join(text) + "\n"


def person_rows(frames, root=(0, 95, 0), **turns):
    """Rows of a person who stands; ``LeftArm=(z, x, y)`` gives degrees from the second frame on."""
    joints = [name for name, _, _ in PERSON if not name.endswith("/End")]
    order = []

    def visit(parent):
        for name, p, _ in PERSON:
            if p == parent:
                if not name.endswith("/End"):
                    order.append(name)
                visit(name)

    visit("")
    assert sorted(order) == sorted(joints)
    row = [*root]
    for name in order:
        row += turns.get(name, (0, 0, 0))
    return [list(row) for _ in range(frames)]
