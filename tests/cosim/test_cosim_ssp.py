"""SSP files: what is written loads elsewhere and here, what is written by hand loads here, mistakes are named."""

import ctypes
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from bench.oscillator_fmu import build
from snarelab.cli import main
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.setup import Hosting, Setup, load_setup
from snarelab.cosim.ssp_write import write_ssp
from snarelab.cosim.system import Connection, System
from snarelab.errors import InputError

HERE = Hosting(own_process=False)
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")


def both(halves, **options):
    connections = [
        ("right.force", "left.force"),
        Connection("left.x", "right.x_left", factor=0.5, offset=0.25),
        ("left.v", "right.v_left"),
    ]
    parts = {side: Fmu(halves / f"{side}2.fmu") for side in ("left", "right")}
    return System(parts, connections, **options)


def test_written_ssp_reads_back_as_the_same_run(halves, tmp_path):
    setup = Setup(both(halves, parameters={"left.mass": 2.0}), 2e-3, stop=0.2, scheme="gauss_seidel", hold="quadratic")
    write_ssp(setup, tmp_path / "system.ssp")
    again = load_setup(tmp_path / "system.ssp", HERE)
    assert (again.step, again.stop, again.scheme, again.hold) == (2e-3, 0.2, "gauss_seidel", "quadratic")
    with setup.master() as one, again.master() as two:
        assert one.run(0.2).recording.equals(two.run(0.2).recording)
    write_ssp(again, tmp_path / "again.ssp")
    assert (tmp_path / "again.ssp").read_bytes() == (tmp_path / "system.ssp").read_bytes()


def test_written_ssp_follows_the_schema_and_runs_in_fmpy(halves, tmp_path):
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssd

    write_ssp(Setup(both(halves), 1e-3), tmp_path / "system.ssp")
    top = read_ssd(str(tmp_path / "system.ssp"), validate=True).system
    assert top is not None
    assert [element.name for element in top.elements] == ["left", "right"]
    result = simulate_ssp(str(tmp_path / "system.ssp"), stop_time=0.1, step_size=1e-3)
    assert np.isfinite(result["left.x"]).all()
    assert result["left.x"][-1] < 1.0


def test_written_ssp_runs_in_ecos_with_its_parameters(halves, tmp_path):
    for library in Path(sys.prefix).glob("lib/libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)  # Ecos wants it and does not look there
    try:
        import ecospy
    except (ImportError, OSError) as reason:
        pytest.skip(f"ecospy cannot be loaded: {reason}")
    system = both(halves, parameters={"left.mass": 2.0, "right.coupling_stiffness": 4.0})
    write_ssp(Setup(system, 1e-3), tmp_path / "system.ssp")
    with ecospy.EcosSimulation(1e-3, ssp_path=str(tmp_path / "system.ssp")) as simulation:
        simulation.init(parameter_set="initialValues")
        simulation.step(500)
        theirs = simulation.get_real("left::x")
        assert simulation.get_real("left::mass") == 2.0
    with Setup(system, 1e-3).master() as master:
        master.run(0.5)
        # Theirs holds inputs constant, and its spring reads a position that is one step old: an error of order H.
        assert theirs == pytest.approx(master.value("left.x"), abs=5e-3)


HAND = """<?xml version="1.0" encoding="UTF-8"?>
<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:v="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="hand">
  <System name="all">
    <ParameterBindings>
      <ParameterBinding source="resources/values.ssv">
        <ParameterMapping source="resources/map.ssm"/>
      </ParameterBinding>
    </ParameterBindings>
    <Elements>
      <System name="inner">
        <Connectors>
          <Connector name="push" kind="input"><ssc:Real unit="N"/></Connector>
          <Connector name="place" kind="output"><ssc:Real unit="m"/></Connector>
          <Connector name="rate" kind="output"/>
        </Connectors>
        <Elements>
          <Component name="mass" source="../system/resources/left%32.fmu">
            <Connectors>
              <Connector name="force" kind="input"><ssc:Real unit="N"/></Connector>
              <Connector name="x" kind="output"><ssc:Real unit="m"/></Connector>
              <Connector name="v" kind="output"/>
            </Connectors>
            <ParameterBindings><ParameterBinding><ParameterValues>
              <v:ParameterSet version="1.0" name="p"><v:Parameters>
                <v:Parameter name="mass"><v:Real value="7"/></v:Parameter>
                <v:Parameter name="damping"><v:Real value="0.5"/></v:Parameter>
              </v:Parameters></v:ParameterSet>
            </ParameterValues></ParameterBinding></ParameterBindings>
          </Component>
        </Elements>
        <Connections>
          <Connection startConnector="push" endElement="mass" endConnector="force">
            <ssc:LinearTransformation factor="2"/>
          </Connection>
          <Connection startElement="mass" startConnector="x" endConnector="place"/>
          <Connection startElement="mass" startConnector="v" endConnector="rate"/>
        </Connections>
      </System>
      <Component name="right" source="resources/right2.fmu" type="application/x-fmu-sharedlibrary">
        <Connectors>
          <Connector name="x_left" kind="input"/>
          <Connector name="v_left" kind="input"/>
          <Connector name="force" kind="output"/>
        </Connectors>
      </Component>
    </Elements>
    <Connections>
      <Connection startElement="right" startConnector="force" endElement="inner" endConnector="push">
        <ssc:LinearTransformation factor="0.5"/>
      </Connection>
      <Connection startElement="inner" startConnector="place" endElement="right" endConnector="x_left"/>
      <Connection startElement="right" startConnector="v_left" endElement="inner" endConnector="rate"/>
    </Connections>
  </System>
  <DefaultExperiment startTime="0" stopTime="0.3"/>
</SystemStructureDescription>
""".replace("../system/", "")
VALUES = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    version="1.0" name="values"><ssv:Parameters>
  <ssv:Parameter name="grams"><ssv:Real value="2000" unit="g"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet>"""
MAP = """<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" version="1.0">
  <ssm:MappingEntry source="grams" target="inner.mass.mass">
    <ssc:LinearTransformation xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" factor="0.5" offset="1"/>
  </ssm:MappingEntry>
</ssm:ParameterMapping>"""


def by_hand(halves, path, description=HAND):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", description)
        archive.writestr("resources/values.ssv", VALUES)
        archive.writestr("resources/map.ssm", MAP)
        for side in ("left", "right"):
            archive.write(halves / f"{side}2.fmu", f"resources/{side}2.fmu")
    return path


def test_ssp_written_by_hand_loads(halves, tmp_path):
    """Nested systems, a reversed connection, transformations across a border, mapped parameters with units."""
    setup = load_setup(by_hand(halves, tmp_path / "hand.ssp"), HERE)
    assert list(setup.system.participants) == ["inner_mass", "right"]
    assert setup.system.given == {"inner_mass.mass": 2.0, "inner_mass.damping": 0.5}
    assert {(c.source, c.target, c.factor) for c in setup.system.connections} == {
        ("right.force", "inner_mass.force", 1.0),
        ("inner_mass.x", "right.x_left", 1.0),
        ("inner_mass.v", "right.v_left", 1.0),
    }
    flat = System(
        {"m": LeftOscillator(), "right": Fmu(halves / "right2.fmu")},
        [("right.force", "m.force"), ("m.x", "right.x_left"), ("m.v", "right.v_left")],
        parameters={"m.mass": 2.0, "m.damping": 0.5},
    )
    with setup.master() as read, Setup(flat).master() as ours:
        read.run(setup.stop)
        ours.run(0.3)
        assert read.value("inner_mass.x") == pytest.approx(ours.value("m.x"), abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('version="1.0" name="hand"', 'version="2.0" name="hand"', "is of SSP 2.0"),
        ("resources/right2.fmu", "resources/wrong.fmu", "'resources/wrong.fmu' is not in the archive"),
        ("resources/right2.fmu", "../right2.fmu", "'../right2.fmu' is not in the archive"),
        ('"application/x-fmu-sharedlibrary"', '"application/x-ssp-package"', "is a application/x-ssp-package"),
        ('endElement="right" endConnector="x_left"', 'endElement="rihgt" endConnector="x_left"', "names the element"),
        ('name="damping"', 'name="dumping"', "nearest is 'inner.mass.damping'"),
        ('name="x" kind="output"><ssc:Real unit="m"/>', 'name="y" kind="output">', "names the connector 'x'"),
        ('<ssc:LinearTransformation factor="2"/>', "<ssc:IntegerMappingTransformation/>", "only linear"),
        (
            'name="force" kind="input"><ssc:Real unit="N"/>',
            'name="force" kind="input"><ssc:Real unit="kN"/>',
            "is in kN",
        ),
        ("resources/right2.fmu", "resources/", "'resources/' is not in the archive"),
        (' source="resources/values.ssv"', "", "has neither values nor a source"),
        ('<v:Real value="7"/>', '<v:Integer value="seven"/>', "parameter 'mass': value = 'seven' is no finite number"),
        ('<v:Real value="7"/>', '<v:Real value="inf"/>', "parameter 'mass': value = 'inf' is no finite number"),
        ("<SystemStr", '<!DOCTYPE x [<!ENTITY a "b">]><SystemStr', "declares a document type"),
        ("</System>\n  <Def", "</Systm>\n  <Def", "is no XML"),
    ],
)
def test_mistakes_in_ssp_are_named_with_the_file(halves, tmp_path, old, new, message):
    assert old in HAND
    path = by_hand(halves, tmp_path / "bad.ssp", HAND.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_setup(path, HERE)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_circle_of_connectors_is_no_connection(halves, tmp_path):
    circle = HAND
    for old, new in (
        ('startElement="mass" startConnector="x" endConnector="place"', 'startConnector="push" endConnector="place"'),
        ('startElement="right" startConnector="force" endE', 'startElement="inner" startConnector="place" endE'),
    ):
        assert old in circle
        circle = circle.replace(old, new)
    with pytest.raises(InputError, match=r"the connections into inner_mass\.force run in a circle"):
        load_setup(by_hand(halves, tmp_path / "circle.ssp", circle), HERE)


def test_a_description_without_a_system_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", '<a version="1.0"/>')
    with pytest.raises(InputError, match="has no System"):
        load_setup(tmp_path / "empty.ssp", HERE)


@pytest.mark.parametrize(
    ("limit", "words"), [("_LARGEST", "SystemStructure.ssd: would"), ("_LARGEST_FMUS", "all FMUs")]
)
def test_what_unpacks_to_too_much_is_refused(halves, tmp_path, monkeypatch, limit, words):
    monkeypatch.setattr(f"snarelab.cosim.ssp.{limit}", 1000)
    with pytest.raises(InputError, match=words):
        load_setup(by_hand(halves, tmp_path / "large.ssp"), HERE)


def test_whole_numbers_and_truth_are_numbers_and_text_is_left_out(halves, tmp_path):
    typed = HAND.replace('<v:Real value="7"/>', '<v:Integer value="7"/>').replace(
        '<v:Real value="0.5"/>', '<v:Boolean value="true"/>'
    )
    text = '<v:Parameter name="note"><v:String value="a mass"/></v:Parameter><v:Parameter name="damping">'
    typed = typed.replace('<v:Parameter name="damping">', text)
    typed = typed.replace('<ParameterMapping source="resources/map.ssm"/>', "").replace(
        'source="resources/values.ssv"', 'source="resources/none.ssv"'
    )
    path = by_hand(halves, tmp_path / "typed.ssp", typed)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/none.ssv", '<ParameterSet version="1.0" name="none"/>')
    setup = load_setup(path, HERE)
    assert setup.system.given == {"inner_mass.mass": 7.0, "inner_mass.damping": 1.0}


def test_inputs_that_an_ssp_leaves_open_keep_their_start_values(halves, tmp_path, capsys):
    lone = HAND.replace(
        '<Connection startElement="inner" startConnector="place" endElement="right" endConnector="x_left"/>', ""
    )
    setup = load_setup(by_hand(halves, tmp_path / "open.ssp", lone), HERE)
    assert setup.open == ("right.x_left",)
    assert setup.system.given["right.x_left"] == 0.0
    for participant in setup.system.participants.values():
        participant.close()
    assert main(["cosim", str(tmp_path / "open.ssp"), "--out", str(tmp_path / "run.csv"), "--same-process"]) == 0
    assert "nothing is connected to right.x_left: it kept its start value" in capsys.readouterr().out


def test_unconverted_units_are_refused_only_where_they_differ(halves, tmp_path):
    plain = HAND.replace(
        '<Connection startElement="right"', '<Connection suppressUnitConversion="true" startElement="right"'
    )
    assert plain != HAND
    load_setup(by_hand(halves, tmp_path / "same.ssp", plain), HERE)
    other = tmp_path / "kilo"
    other.mkdir()
    build(other, "left", 2, units={"force": "kN"})
    build(other, "right", 2)
    bare = plain.replace('<ssc:Real unit="N"/>', "")
    with pytest.raises(InputError, match="N is to be read as kN unconverted"):
        load_setup(by_hand(other, tmp_path / "kilo.ssp", bare), HERE)


def test_what_is_no_archive_is_refused(tmp_path):
    (tmp_path / "text.ssp").write_text("hello")
    with pytest.raises(InputError, match="no ZIP archive"):
        load_setup(tmp_path / "text.ssp", HERE)


def test_only_fmus_go_into_an_ssp(tmp_path):
    system = System({"left": LeftOscillator()}, parameters={"left.force": 0.0})
    with pytest.raises(InputError, match="'left' is no FMU"):
        write_ssp(Setup(system), tmp_path / "x.ssp")
    assert not list(tmp_path.iterdir())
