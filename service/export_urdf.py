"""An estimate as URDF: the original document with the inertials and losses found."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable

from identify.inertia import body_from_parameters
from service.export_model import DriveTerms, ExportModel, FloatArray

NOT_HELD = (
    "URDF has no place for constant offsets, asymmetric friction, gravity compensation and rotor inertia; "
    "they are left out of this file"
)

COUPLED = "The transmission is coupled: its friction acts on combinations of joints, which URDF cannot say."


def comment_text(lines: Iterable[str]) -> str:
    """Join lines to the text of an XML comment, in which two hyphens may not meet."""
    return " " + "\n     ".join(" ".join(line.split()) for line in lines).replace("--", "- -") + " "


def header(export: ExportModel, extra: Iterable[str] = ()) -> str:
    """Say where a file comes from, as an XML comment."""
    estimate = export.estimate
    made = f"Written by residuum from the {estimate.model.kind} estimate of robot {estimate.loaded.name}."
    marks = [f"simulated: {'true' if estimate.simulated else 'false'}", made]
    return f"<!--{comment_text([*marks, *export.notes, *extra])}-->\n"


def urdf_text(export: ExportModel) -> str:
    """Write the URDF.

    Args:
        export: the numbers.

    Returns:
        The document; inertials of links behind fixed joints are merged into the moving link.
    """
    chain = export.estimate.loaded.chain
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root = ElementTree.fromstring(export.estimate.loaded.urdf_text, parser=parser)
    moving = {joint.link: export.links[k] for k, joint in enumerate(chain.joints)}
    for link in root.findall("link"):
        name = link.get("name", "")
        if chain.link_of.get(name, -1) < 0:
            continue  # the base: nothing of it is identified
        for old in link.findall("inertial"):
            link.remove(old)
        if name in moving:
            link.insert(0, _inertial(moving[name]))
    if export.estimate.model.kind != "external" and export.robot.coupling is None:
        drives = {drive.joint: drive for drive in export.drives}
        for joint in root.findall("joint"):
            if joint.get("name") in drives:
                _set_losses(joint, drives[joint.get("name", "")])
    ElementTree.indent(root, "  ")
    notes = [NOT_HELD + "."]
    if export.robot.coupling is not None:
        notes.append(COUPLED)
    text = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0"?>\n' + header(export, notes) + text + "\n"


def _inertial(parameters: FloatArray) -> ElementTree.Element:
    mass, com, inertia = body_from_parameters(parameters)
    element = ElementTree.Element("inertial")
    ElementTree.SubElement(element, "origin", xyz=numbers(com), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=number(mass))
    keys = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))
    ElementTree.SubElement(
        element, "inertia", {key: number(inertia[row, column]) for key, row, column in keys}
    )
    return element


def _set_losses(joint: ElementTree.Element, drive: DriveTerms) -> None:
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = ElementTree.SubElement(joint, "dynamics")
    dynamics.set("damping", number(drive.viscous))
    dynamics.set("friction", number(drive.coulomb))


def number(value: float) -> str:
    """Write a number so that it reads back as the same one."""
    return repr(float(value))


def numbers(values: FloatArray | Iterable[float]) -> str:
    """Write numbers so that they read back as the same ones."""
    return " ".join(number(value) for value in values)
