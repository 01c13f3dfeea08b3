"""A real browser without a window; tests are skipped where none is installed."""

import shutil

import pytest

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--hide-scrollbars", "--mute-audio", "--window-size=1100,760"),
)
CALM = ("--force-prefers-reduced-motion",)  # what stands takes no time to draw
DRAWING = (*CALM, "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NOT_DRAWING = (*CALM, "--disable-3d-apis")


@pytest.fixture(scope="session")
def start_browser(tmp_path_factory):
    """Start browsers; all of them end with the session."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("no Chromium here to look at pages with; it is chromium, chromium-driver")
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    started = []

    def start(*flags):
        options = ChromeOptions()
        options.binary_location = chromium
        for flag in (*FLAGS, *flags, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        started.append(Chrome(options, Service(driver)))
        return started[-1]

    yield start
    for browser in started:
        browser.quit()


@pytest.fixture(scope="session")
def drawing_browser(start_browser):
    """A browser that draws in three dimensions, by its own processor."""
    return start_browser(*DRAWING)


@pytest.fixture(scope="session")
def flat_browser(start_browser):
    """A browser without WebGL."""
    return start_browser(*NOT_DRAWING)


@pytest.fixture
def browser(drawing_browser):
    """The browser that draws, with nothing in its logs."""
    for kind in ("browser", "performance"):
        drawing_browser.get_log(kind)
    return drawing_browser
