"""What a reader does with a page of results, done in Chromium: `.ci/pages` makes the pages and calls this.

    python tests/pages.py report.html ...
"""

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

#: What an x axis shows and could show: of the first chart of a place.
SHOWN = "place => { const x = place.charts[0].scales.x; return [x.min, x.max]; }"


def span(place):
    low, high = place.evaluate(SHOWN)
    return high - low


def first_chart(page):
    # A figure with samples is a chart once it comes near: on a narrow screen the first one stands far below.
    page.locator("figure:has(script)").first.scroll_into_view_if_needed()
    page.locator("figure.live .plot").first.wait_for()
    place = page.locator("figure.live .plot").first
    place.scroll_into_view_if_needed()
    return place


def has_ink(place, name):
    """Whether the first chart has pixels of a colour of the page's style as it is now."""
    return place.evaluate(
        """(place, name) => {
            const style = getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
            const wanted = [1, 3, 5].map((k) => parseInt(style.slice(k, k + 2), 16));
            const canvas = place.querySelector("canvas");
            const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
            let count = 0;
            for (let k = 0; k < pixels.length; k += 4) {
                if (pixels[k + 3] > 200 && wanted.every((v, c) => Math.abs(v - pixels[k + c]) < 12)) count++;
            }
            return count > 50;
        }""",
        name,
    )


def zooms(page):
    place = first_chart(page)
    whole = span(place)
    over = place.locator(".u-over").first
    box = over.bounding_box()
    across = lambda share: (box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.move(*across(0.3))
    page.mouse.down()
    page.mouse.move(*across(0.5), steps=5)
    page.mouse.up()
    part = span(place)
    assert abs(part / whole - 0.2) < 0.03, f"dragging over a fifth shows {part / whole:.3f} of the axis"
    spans = place.evaluate("place => place.charts.map(c => c.scales.x.max - c.scales.x.min)")
    assert max(spans) - min(spans) < 1e-6 * whole, f"the panels of a figure show different stretches: {spans}"
    page.mouse.dblclick(*across(0.5))
    assert abs(span(place) / whole - 1) < 1e-6, "a double click does not show all"


def tells_values_at_the_cursor_and_hides_joints(page):
    place = first_chart(page)
    box = place.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
    values = place.locator(".u-legend").first.locator(".u-value").all_text_contents()
    assert len(values) > 1 and all(any(c.isdigit() for c in value) for value in values), values
    row = place.locator(".u-legend").first.locator(".u-series").nth(1)
    row.locator("th").click()
    assert "u-off" in row.get_attribute("class"), "a click on a name hides nothing"
    row.locator("th").focus()
    page.keyboard.press("Enter")
    assert "u-off" not in row.get_attribute("class"), "Enter on a name does not bring it back"


def obeys_the_keyboard(page):
    place = first_chart(page)
    place.focus()
    whole = span(place)
    page.keyboard.press("+")
    page.keyboard.press("+")
    assert abs(span(place) / whole - 0.25) < 0.01, "plus does not zoom"
    before = place.evaluate(SHOWN)
    page.keyboard.press("ArrowRight")
    assert place.evaluate(SHOWN)[0] > before[0], "an arrow does not move"
    page.keyboard.press("Escape")
    assert abs(span(place) / whole - 1) < 1e-6, "Escape does not show all"


def follows_the_dark(page):
    place = first_chart(page)
    for scheme in ("light", "dark", "light"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_timeout(300)
        assert has_ink(place, "c1") or has_ink(place, "c2"), f"curves are not drawn in the colours of a {scheme} page"


def prints_drawings(page):
    first_chart(page)
    page.emulate_media(media="print")
    assert page.locator("figure.live > svg").first.is_visible(), "nothing is printed of a figure"
    assert not page.locator("figure.live .plot").first.is_visible(), "a chart is printed over its drawing"
    page.emulate_media(media="screen")


def fits_a_telephone(page):
    page.set_viewport_size({"width": 400, "height": 800})
    place = first_chart(page)
    page.wait_for_timeout(300)
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= 400, f"the page is {width} px wide on a screen of 400"
    cut = page.evaluate(
        """[...document.querySelectorAll("figure, .table")]
            .filter((e) => e.classList.contains("live") || !e.querySelector("script"))
            .filter((e) => e.scrollWidth > e.clientWidth + 1)
            .map((e) => e.className + " " + e.textContent.slice(0, 40))"""
    )
    assert not cut, f"these are cut on a screen of 400 px: {cut}"
    box = place.locator(".uplot").first.bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= 400.5, f"a chart is cut: {box}"


def main():
    checks = [
        zooms,
        tells_values_at_the_cursor_and_hides_joints,
        obeys_the_keyboard,
        follows_the_dark,
        prints_drawings,
        fits_a_telephone,
    ]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        for file in sys.argv[1:]:
            address = Path(file).resolve().as_uri()
            for check in checks:
                page = browser.new_page(viewport={"width": 1000, "height": 800})
                wrong, asked = [], []
                page.on("pageerror", lambda error: wrong.append(str(error)))
                page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
                page.on("request", lambda request: asked.append(request.url))
                page.goto(address)
                check(page)
                assert not wrong, wrong
                assert asked == [address], f"the page asks for {asked}"
                page.close()
            plain = browser.new_context(java_script_enabled=False).new_page()
            plain.goto(address)
            assert plain.locator("figure > svg").first.is_visible(), "without a script there is no figure"
            print(f"{file}: {len(checks) + 1} checks of {browser.version} passed")
        browser.close()


main()
