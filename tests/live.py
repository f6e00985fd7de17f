"""What a person sees of `powerball follow --serve` in Chromium, while the arm moves: `.ci/pages` calls this.

    python tests/live.py PROGRAM FOLDER_OF_A_DEMO
"""

import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

POINTS = """() => Object.fromEntries([...document.querySelectorAll("#charts figure")].map((figure) => [
    figure.id, figure.querySelectorAll("canvas").length]))"""


def main(program, folder):
    folder = Path(folder)
    run = subprocess.Popen(
        [program, "follow", "--trajectory", folder / "path.csv", "--arm", folder / "arm.toml", "--floor", "none"]
        + ["--model", folder / "model.json", "--plant", folder / "virtual_arm.json", "--with", "torque"]
        + ["--serve", "127.0.0.1:0", "--out", folder / "live"],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    try:
        address = next(line for line in run.stderr if "http://" in line).split()[-1]
        with sync_playwright() as p:
            browser = p.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            page = browser.new_page()
            errors = []
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.goto(address)
            page.wait_for_selector("#field-external_torque canvas", timeout=15_000)
            early = page.inner_text("#state")
            assert run.poll() is None, "the page came after the run"
            # What shows that it goes on: the time that the page says.
            page.wait_for_function("before => document.getElementById('state').textContent !== before", arg=early)
            fields = page.evaluate(POINTS)
            names = ["error", "external_torque", "rigid_arm", "friction", "effects", "feedback"]
            assert fields == {f"field-{name}": 1 for name in names}, fields
            # Who comes late sees all from the beginning.
            late = browser.new_page()
            late.goto(address)
            late.wait_for_selector("#field-error canvas", timeout=15_000)
            page.wait_for_selector("#events .note", timeout=60_000)
            assert page.inner_text("#events").startswith("done"), page.inner_text("#events")
            assert not errors, errors
            browser.close()
        assert run.wait(timeout=60) == 0
    finally:
        run.kill()
    print("the live page: six charts while the arm moved, and its end")


if __name__ == "__main__":
    main(*sys.argv[1:])
