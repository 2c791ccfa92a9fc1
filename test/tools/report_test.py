"""`report` makes one page that a browser can read by itself: well-formed, drawings included."""
import html.parser
import json
import pathlib
import re
import tempfile
import unittest
import xml.etree.ElementTree

from commands import run

VOID = {"meta", "img"}


class Balance(html.parser.HTMLParser):
    """Complains about an element that is not closed, or closed by another."""

    def __init__(self):
        super().__init__()
        self.open = []
        self.sources = []

    def handle_starttag(self, tag, attrs):
        self.sources += [value for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        pass

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, (self.open, tag, self.getpos())
        self.open.pop()


def report(views):
    rows = [{"index": i, "stamp_ns": i * 500_000_000, "registered": i != 1,
             "reason": "<&\">" if i == 1 else None, "trial": 1, "points": 1000 + i,
             "mean_distance_m": 0.001, "prior_arc_deg": 0.1, "prior_rho_m": 0.002} for i in range(views)]
    return {"tables": {"views": rows}, "warnings": ["<b>&amp;"], "trials": {"1": views},
            "time_s": {"stereo": 1.5, "surface": None}}


class Report(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.place.name)
        self.addCleanup(self.place.cleanup)

    def page(self, content):
        (self.folder / "report.json").write_text(json.dumps(content))
        (self.folder / "trajectory.tum").write_text(
            "".join(f"{i * 0.5:.9f} {i * 0.1} {i % 3} 0 0 0 0 1\n" for i in range(6) if i != 1))
        code, _, error = run("report", self.folder)
        self.assertEqual(code, 0, error)
        return (self.folder / "report.html").read_text(encoding="utf-8")

    def test_is_well_formed_and_whole(self):
        page = self.page(report(6))
        balance = Balance()
        balance.feed(page)
        self.assertEqual(balance.open, [])
        for source in balance.sources:
            self.assertRegex(source, "^(data:image/|#)")
        drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
        self.assertGreaterEqual(len(drawings), 6)
        for drawing in drawings:
            root = xml.etree.ElementTree.fromstring(drawing)
            self.assertEqual(root.tag, "svg")
            for element in root.iter():
                for value in element.attrib.values():
                    self.assertNotRegex(value, "nan|inf|\u2013")

    def test_an_empty_report_is_well_formed_too(self):
        balance = Balance()
        balance.feed(self.page({}))
        self.assertEqual(balance.open, [])

    def test_names_what_it_cannot_read(self):
        code, _, error = run("report", self.folder)
        self.assertEqual(code, 1)
        self.assertEqual(len(error.strip().splitlines()), 1)
        self.assertIn("report.json", error)
        (self.folder / "report.json").write_text("{\"views\": ")
        code, _, error = run("report", self.folder)
        self.assertEqual(code, 1)
        self.assertIn(str(self.folder / "report.json"), error)
        self.assertEqual(run("report")[0], 2)


if __name__ == "__main__":
    unittest.main()
