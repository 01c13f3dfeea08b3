import json
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from mocapidx.reports.page.html import page_html
from tests.made_page import ODD, content, several_hits

WAIT = 60  # seconds; a page needs less than one


@pytest.fixture(scope="session")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page_html(several_hits()))
    return path.as_uri()


def until(condition):
    """Wait for something to become true; give what it was."""
    end = time.monotonic() + WAIT
    while not (found := condition()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.03)
    return found


def script(browser, text, *arguments):
    return browser.execute_script(text, *arguments)


def one(browser, selector):
    return browser.find_element("css selector", selector)


def press(browser, keys):
    one(browser, "body").send_keys(keys)


def opened(browser, address):
    """Open a page, and wait until its large figure is drawn."""
    browser.get(address)
    until(lambda: script(browser, "return document.getElementById('view')?.width > 300"))
    until(lambda: colours(browser) > 20)
    return browser


def colours(browser, selector="#view"):
    """How many colours a canvas has."""
    return script(
        browser,
        "const canvas = document.querySelector(arguments[0]);"
        "if (!canvas || !canvas.width) return 0;"
        "const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
        "return new Set(new Uint32Array(data.buffer)).size",
        selector,
    )


def pixels(browser, selector="#view"):
    return script(browser, "return document.querySelector(arguments[0]).toDataURL()", selector)


def text(browser, name):
    return script(browser, "return document.getElementById(arguments[0]).textContent", name)


def settled(browser):
    browser.execute_async_script(
        "const done = arguments[0]; let left = 4;"
        "const next = () => (left-- ? requestAnimationFrame(next) : done());"
        "next()"
    )


def choose(browser, name, value):
    """Take an option of a list, as a person does."""
    script(
        browser,
        "const list = document.getElementById(arguments[0]); list.value = arguments[1];"
        "list.dispatchEvent(new Event('change', { bubbles: true }));"
        "list.dispatchEvent(new Event('input', { bubbles: true }))",
        name,
        value,
    )
    settled(browser)


def slide(browser, name, share):
    script(
        browser,
        "const slider = document.getElementById(arguments[0]); slider.value = 1000 * arguments[1];"
        "slider.dispatchEvent(new Event('input', { bubbles: true }))",
        name,
        share,
    )
    settled(browser)


def shown_cards(browser):
    return script(
        browser,
        "return [...document.querySelectorAll('.card')].filter((card) => !card.hidden)"
        ".map((card) => Number(card.dataset.hit))",
    )


def chosen(browser):
    return script(browser, "return Number(document.querySelector('[aria-current]').dataset.hit)")


def complaints(browser):
    """What the console says, but for the driver's remarks on its speed."""
    return [row for row in browser.get_log("browser") if row["source"] != "rendering"]


def prefer(browser, **media):
    """Ask for what a system can prefer; nothing: as it is."""
    features = [
        {"name": f"prefers-{name.replace('_', '-')}", "value": value}
        for name, value in media.items()
    ]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def test_the_figures_move(browser, page):
    prefer(browser, reduced_motion="no-preference")
    opened(browser, page)
    for selector in ("#view", ".card canvas"):
        before = pixels(browser, selector)
        until(lambda selector=selector, before=before: pixels(browser, selector) != before)
    before = text(browser, "clock")
    until(lambda: text(browser, "clock") != before)
    one(browser, "#play").click()
    one(browser, "#play-all").click()
    settled(browser)
    before = [pixels(browser, selector) for selector in ("#view", ".card canvas")]
    settled(browser)
    assert [pixels(browser, selector) for selector in ("#view", ".card canvas")] == before
    prefer(browser)


def test_nothing_is_fetched_and_the_console_is_silent(browser, page):
    opened(browser, page)
    for keys in ("c", "w", "t", "]", "."):
        press(browser, keys)
    settled(browser)
    asked = [json.loads(row["message"])["message"] for row in browser.get_log("performance")]
    addresses = [
        each["params"]["request"]["url"]
        for each in asked
        if each["method"] == "Network.requestWillBeSent"
    ]
    assert [each for each in addresses if not each.startswith(("file:", "data:"))] == []
    assert complaints(browser) == []


def test_the_policy_stops_what_would_go_outside(browser, page):
    heard = []

    class Listener(BaseHTTPRequestHandler):
        def do_GET(self):
            heard.append(self.path)

        def log_message(self, *arguments):
            pass

    with HTTPServer(("127.0.0.1", 0), Listener) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        opened(browser, page)
        address = f"http://127.0.0.1:{server.server_port}/"
        refused = browser.execute_async_script(
            "const [address, done] = arguments; const refused = [];"
            "document.addEventListener('securitypolicyviolation', (event) => {"
            "  refused.push(event.effectiveDirective);"
            "  if (refused.length === 3) done(refused.sort());"
            "});"
            "fetch(`${address}fetch`).catch(() => {});"
            "new Image().src = `${address}image`;"
            "const program = document.createElement('script');"
            "program.textContent = 'window.reached = true';"
            "document.body.append(program)",
            address,
        )
        server.shutdown()
    assert refused == ["connect-src", "img-src", "script-src-elem"]
    assert heard == []
    assert script(browser, "return window.reached") is None


def test_stopped_figures_stand_until_time_is_set(browser, page):
    opened(browser, page)
    settled(browser)
    first = pixels(browser)
    settled(browser)
    assert pixels(browser) == first
    slide(browser, "scrub", 0.0)
    start, clock = pixels(browser), text(browser, "clock")
    slide(browser, "scrub", 0.3)
    assert pixels(browser) != start
    assert clock.startswith("0.00 /")
    assert text(browser, "clock").startswith("0.59 /")
    slide(browser, "scrub", 0.0)
    assert pixels(browser) == start


def test_steps_by_key_are_frames(browser, page):
    opened(browser, page)
    slide(browser, "scrub", 0.0)
    press(browser, ".")
    press(browser, ".")
    settled(browser)
    assert text(browser, "clock").startswith("0.07 /")
    press(browser, ",")
    settled(browser)
    assert text(browser, "clock").startswith("0.03 /")


def test_a_hit_stands_beside_the_query_over_it_or_alone(browser, page):
    opened(browser, page)
    press(browser, "\ue014")  # right: the second hit
    assert chosen(browser) == 1
    settled(browser)
    slide(browser, "scrub", 0.5)
    seen = set()
    for mode in ("beside", "over", "off"):
        choose(browser, "beside", mode)
        seen.add(pixels(browser))
        assert one(browser, "#legend-reference").is_displayed() == (mode != "off")
    assert len(seen) == 3
    assert text(browser, "reference-name") == "best of wave"
    press(browser, "\ue012")  # left: the best hit itself
    assert not one(browser, "#beside-choice").is_displayed()


def test_the_query_goes_in_step(browser, page):
    # The third hit takes two frames where the query takes one, so that two poses look alike.
    opened(browser, page)
    got = script(
        browser,
        "const hit = JSON.parse(document.getElementById('data').textContent).hits[2];"
        "return [hit.steps[10], hit.steps[11], hit.steps[79]]",
    )
    assert got == [5, 5, 39]


def test_filters_leave_what_passes(browser, page):
    opened(browser, page)
    assert shown_cards(browser) == [0, 1, 2, 3, 4]
    names = [each.text for each in browser.find_elements("css selector", ".class")]
    assert [" ".join(name.split()) for name in names] == ["stand 1", "wave 4"]
    browser.find_elements("css selector", ".class")[0].click()
    assert shown_cards(browser) == [0, 1, 2, 4]
    assert text(browser, "shown") == "4 of 5"
    slide(browser, "cost", 0.5)
    assert shown_cards(browser) == [0, 1, 2]
    one(browser, "#part").send_keys("CLIPS")
    assert shown_cards(browser) == [0, 1]
    one(browser, "#part").send_keys("nothing like this")
    assert shown_cards(browser) == []
    assert one(browser, "#none-left").is_displayed()


def test_cards_are_put_in_order(browser, page):
    opened(browser, page)
    choose(browser, "order", "length")
    assert shown_cards(browser) == [1, 0, 2, 3, 4]
    choose(browser, "order", "document")
    assert shown_cards(browser) == [0, 1, 2, 3, 4]
    choose(browser, "order", "file")
    assert shown_cards(browser) == [0, 1, 2, 3, 4]


def test_the_keyboard_reaches_everything(browser, page):
    opened(browser, page)
    tops = [each.location["y"] for each in browser.find_elements("css selector", ".card")]
    below = 1 + tops.count(tops[0])
    for keys, expected in (("\ue014", 1), ("\ue014", 2), ("\ue012", 1), ("\ue015", below)):
        press(browser, keys)
        assert chosen(browser) == expected
    before = one(browser, "#speed").get_attribute("value")
    press(browser, "[")
    assert float(one(browser, "#speed").get_attribute("value")) < float(before)
    press(browser, "?")
    assert one(browser, "#help").is_displayed()
    one(browser, "#help button").click()
    press(browser, "/")
    one(browser, "#part").send_keys("w a")  # letters that mean something elsewhere
    assert one(browser, "#part").get_attribute("value") == "w a"
    assert one(browser, "#range").get_attribute("value") == "hit"
    card = browser.find_elements("css selector", ".card button")[0]
    assert card.tag_name == "button"


def test_a_take_plays_whole_and_says_what_goes_on(browser, page):
    opened(browser, page)
    browser.find_elements("css selector", ".card button")[3].click()
    settled(browser)
    choose(browser, "range", "take")
    assert text(browser, "clock").endswith("/ 10.00 s")
    assert text(browser, "now") == "stand"
    slide(browser, "scrub", 0.9)
    assert text(browser, "now") == "wave"
    assert colours(browser, "#timeline canvas") > 4


def test_turning_and_going_near_change_the_view(browser, page):
    opened(browser, page)
    settled(browser)
    first = pixels(browser)
    press(browser, "+")
    settled(browser)
    near = pixels(browser)
    press(browser, "0")
    settled(browser)
    assert near != first
    assert pixels(browser) == first
    from selenium.webdriver import ActionChains

    ActionChains(browser).drag_and_drop_by_offset(one(browser, "#viewport"), 60, 20).perform()
    settled(browser)
    assert pixels(browser) not in {first, near}


def test_light_and_dark_are_the_systems_until_chosen(browser, page):
    def ground():
        return script(browser, "return getComputedStyle(document.body).backgroundColor")

    grounds = []
    for scheme in ("light", "dark"):
        prefer(browser, color_scheme=scheme)
        opened(browser, page)
        grounds.append(ground())
    assert grounds[0] != grounds[1]
    one(browser, "#theme").click()
    assert ground() == grounds[0]
    prefer(browser)


def test_who_wants_no_movement_gets_none_until_asking_for_it(browser, page):
    prefer(browser, reduced_motion="reduce")
    opened(browser, page)
    before = pixels(browser)
    settled(browser)
    assert pixels(browser) == before
    one(browser, "#play").click()
    until(lambda: pixels(browser) != before)
    prefer(browser)


def test_nothing_is_wider_than_a_phone(browser, page):
    size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    opened(browser, page)
    assert script(browser, "return document.documentElement.scrollWidth") == 390
    assert script(browser, "return document.getElementById('view').width") > 600
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_names_are_inert(browser, tmp_path):
    path = tmp_path / "odd.html"
    path.write_text(page_html(content(name=f"a/{ODD}.bvh", label=ODD, title=ODD)))
    opened(browser, path.as_uri())
    assert "<script>alert" in browser.title
    assert '<script>alert("1")</script>' in text(browser, "stage-label")
    assert script(browser, "return document.scripts.length") == 3
    assert complaints(browser) == []


def test_every_control_has_a_name(browser, page):
    opened(browser, page)
    nameless = script(
        browser,
        "return [...document.querySelectorAll('button, input, select')].filter((each) =>"
        " !(each.textContent.trim() || each.ariaLabel || each.labels?.length))"
        ".map((each) => each.outerHTML)",
    )
    assert nameless == []


def test_without_webgl_a_still_picture_is_shown(flat_browser, page):
    flat_browser.get(page)
    until(lambda: one(flat_browser, "#trouble").is_displayed())
    assert "no WebGL" in text(flat_browser, "trouble")
    assert one(flat_browser, "#stage-still svg").is_displayed()
    assert one(flat_browser, ".card .still").is_displayed()
    flat_browser.find_elements("css selector", ".card button")[2].click()
    assert chosen(flat_browser) == 2
    assert [row for row in complaints(flat_browser) if row["source"] != "console-api"] == []


def test_without_programs_the_hits_can_be_read(flat_browser, page):
    flat_browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    flat_browser.get(page)
    cards = flat_browser.find_elements("css selector", ".card")
    assert len(cards) == 5
    assert "clips/a.bvh" in cards[0].text
    assert cards[0].find_element("css selector", ".still").is_displayed()
    assert not flat_browser.find_element("css selector", "#filters").is_displayed()
    flat_browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_a_page_of_no_hits_is_quiet(browser, tmp_path):
    path = tmp_path / "none.html"
    path.write_text(page_html(content(hits=(), documents=(), references=())))
    browser.get(path.as_uri())
    until(lambda: "There are no hits" in one(browser, "body").text)
    assert complaints(browser) == []
