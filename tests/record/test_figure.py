"""Contents of the figures and of the HTML page."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from matplotlib.image import imread

from catenary import record
from catenary.errors import RecordingError
from catenary.record.figure import draw
from catenary.record.file import RecordingFile
from catenary.record.recording import Recording
from catenary.record.timeline import quick_stops
from tests.record.made import make_event, make_layout, make_rows


def make_recording(axes: int, count: int = 400) -> Recording:
    layout = make_layout(axes)
    rows = make_rows(layout, count)
    return Recording(layout, rows, (make_event(100),), 0, "the loop ended")


@pytest.mark.parametrize("axes", [1, 6, 33])
def test_each_axis_has_position_error_and_torque(axes: int) -> None:
    recording = make_recording(axes)
    upper, _, lower = draw(recording).subfigs
    assert len(upper.axes) == 3 * axes
    assert len(lower.axes) == 3
    titles = [plot.get_title(loc="left") for plot in upper.axes[:3]]
    assert titles == ["position [rad]", "tracking error [mrad]", "torque [N·m]"]
    names = [plot.get_ylabel() for plot in upper.axes[::3]]
    assert tuple(names) == recording.axes
    reference, actual = upper.axes[-3].lines[:2]
    assert np.array_equal(reference.get_ydata(), recording["commanded_position"][:, -1])
    assert np.array_equal(actual.get_ydata(), recording["position"][:, -1])


def test_degrees_and_a_choice_of_axes() -> None:
    recording = make_recording(6)
    upper, *_ = draw(recording, axes=["joint4"], unit="deg").subfigs
    assert [plot.get_title(loc="left") for plot in upper.axes][:2] == [
        "position [°]",
        "tracking error [°]",
    ]
    drawn = upper.axes[0].lines[1].get_ydata()
    assert drawn == pytest.approx(np.degrees(recording["position"][:, 4]))


def test_events_are_marked_at_their_time() -> None:
    recording = make_recording(1)
    plot = draw(recording).subfigs[0].axes[0]
    assert plot.lines[-1].get_xdata() == pytest.approx([0.099, 0.099])


def named(recording: Recording) -> list[str]:
    """Return the names on the timeline."""
    return [text.get_text() for text in draw(recording).subfigs[1].axes[0].texts]


def test_events_are_named_on_the_timeline() -> None:
    recording = make_recording(1)
    assert named(recording) == ["DeviceLost"]
    many = replace(recording, events=tuple(make_event(n) for n in range(1, 101)))
    assert named(many)[-1] == "and 76 more"


def test_a_part_keeps_the_times_of_the_whole_recording(tmp_path: Path) -> None:
    whole = make_recording(1)
    path = tmp_path / "x.mcap"
    file = RecordingFile(path, whole.layout)
    file.write(whole.rows)
    file.write_event(make_event(300))
    file.finish({})
    part = record.read(path, start=0.25, end=0.35)
    upper = draw(part).subfigs[0]
    actual, event = upper.axes[0].lines[1:3]
    assert actual.get_xdata()[[0, -1]] == pytest.approx([0.25, 0.35])
    assert event.get_xdata()[0] == pytest.approx(0.299)
    assert "101 cycles in 0.100 s" in draw(part).get_suptitle()


def test_quick_stops_are_marked_in_the_cycle_that_sends_them() -> None:
    """IEC 61800-7-201: bit 7 and bit 2 of the controlword clear, bit 1 set."""
    recording = make_recording(3)
    words = recording.rows["controlword"]
    words[:] = 0x0F
    words[200:, 1] = 0x02
    words[250:260] = 0x8012  # bits of the manufacturer and of the mode do not matter
    words[300:, 0] = 0x06  # switching off is not a quick stop
    assert quick_stops(recording) == [(200, [1]), (250, [0, 2])]
    assert named(recording) == ["DeviceLost", "quick stop: joint1", "quick stop: 2 axes"]
    lines = draw(recording).subfigs[0].axes[0].lines[-3:]
    assert [line.get_xdata()[0] for line in lines] == pytest.approx([0.099, 0.2, 0.25])


def test_a_late_cycle_is_visible_on_the_timeline_of_a_long_recording() -> None:
    recording = make_recording(1, 20_000)
    recording.rows["lateness_ns"][12_345] = 800_000
    recording.rows["process_ns"][::2] = -1  # unknown in every other cycle
    lateness, controller = draw(recording).subfigs[1].axes[0].lines[:2]
    assert len(lateness.get_xdata()) == 1400
    assert lateness.get_ydata().max() == 800.0
    assert abs(lateness.get_xdata()[lateness.get_ydata().argmax()] - 12.345) < 0.02
    assert np.isfinite(controller.get_ydata()).all()


def test_a_loop_without_axes_has_its_timing() -> None:
    upper, middle, lower = draw(make_recording(0)).subfigs
    assert [line.get_label() for line in middle.axes[0].lines][:2] == ["lateness", "in controller"]
    assert not upper.axes
    assert [plot.get_title(loc="left").split(":")[0] for plot in lower.axes] == [
        "period",
        "lateness",
        "in controller",
    ]


def test_a_recording_without_a_cycle_is_drawn() -> None:
    figure = draw(make_recording(2, 0))
    assert "0 cycles" in figure.get_suptitle()


def test_a_command_that_is_always_zero_is_not_drawn() -> None:
    recording = make_recording(2)
    recording.rows["commanded_torque"] = 0.0
    recording.rows["commanded_torque"][0] = np.nan
    torque = draw(recording).subfigs[0].axes[2]
    assert [line.get_label() for line in torque.lines[:-1]] == ["actual"]


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_pictures(tmp_path: Path, kind: str) -> None:
    record.plot(make_recording(1), tmp_path / f"x.{kind}")
    data = (tmp_path / f"x.{kind}").read_bytes()
    if kind == "png":
        height, width, _ = imread(tmp_path / "x.png").shape
        assert width == 1540
        assert height > 500
    else:
        texts = {e.text for e in ElementTree.fromstring(data).iter() if e.tag.endswith("}text")}
        assert {"joint0", "tracking error [mrad]", "time [s]"} <= texts


class Page(HTMLParser):
    """Parser that collects the text of a page and its references to other files and scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.foreign: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        if tag in ("script", "img", "iframe", "link"):
            self.foreign.append(tag)
        self.foreign += [
            f"{key}={value}"
            for key, value in attributes
            if key in ("src", "href", "xlink:href") and not str(value).startswith("#")
        ]

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())


def test_a_page_is_self_contained_and_has_tables(tmp_path: Path) -> None:
    recording = make_recording(2)
    evil = msgspec.structs.replace(recording.events[0], message="<script>alert(1)</script>")
    record.plot(replace(recording, events=(evil,)), tmp_path / "x.html")
    page = Page()
    page.feed((tmp_path / "x.html").read_text())
    assert page.foreign == []
    words = set(page.words)
    assert {"Axes", "Events", "joint1", "error, rms [mrad]", evil.message, "DeviceLost"} <= words
    error = recording["commanded_position"] - recording["position"]
    assert f"{np.sqrt((error[:, 0] ** 2).mean()) * 1e3:.4g}" in words


def test_equal_recordings_result_in_equal_pages(tmp_path: Path) -> None:
    for name in ("a", "b"):
        record.plot(make_recording(0), tmp_path / f"{name}.html")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_invalid_plot_options_are_refused(tmp_path: Path) -> None:
    recording = make_recording(2)
    with pytest.raises(RecordingError, match="no axis 'elbow'") as caught:
        record.plot(recording, tmp_path / "x.png", axes=["elbow"])
    assert caught.value.hint == "its axes are joint0, joint1"
    with pytest.raises(RecordingError, match="no field 'target_position'"):
        record.plot(recording, tmp_path / "x.png", reference="target_position")
    with pytest.raises(ValueError, match=r"\.png, \.svg, \.pdf or \.html"):
        record.plot(recording, tmp_path / "x.bmp")
    with pytest.raises(ValueError, match="unit 'turns'"):
        record.plot(recording, tmp_path / "x.png", unit="turns")
    assert not list(tmp_path.iterdir())


def test_linear_axes_are_drawn_in_their_units(tmp_path: Path) -> None:
    layout = make_layout(2)
    units = {"rad": "m", "rad/s": "m/s", "N·m": "N"}
    fields = tuple(
        msgspec.structs.replace(each, unit=units.get(each.unit, each.unit))
        for each in layout.fields
    )
    layout = msgspec.structs.replace(layout, fields=fields)
    recording = Recording(layout, make_rows(layout, 400), (), 0, "the loop ended")
    titles = [plot.get_title(loc="left") for plot in draw(recording).subfigs[0].axes[:3]]
    assert [title.partition("[")[2] for title in titles] == ["m]", "mm]", "N]"]
    record.plot(recording, tmp_path / "x.html", unit="deg")
    page = (tmp_path / "x.html").read_text()
    assert "error, rms [mm]" in page
    assert "torque, rms [N]" in page
