"""The page's server: static files, one WebSocket for each browser, and nothing else.

A browser is served from a bounded queue; one that does not keep up is dropped, and connects anew.
A request goes to the run's socket in a thread, by two connections: one for what must never wait
(beats, stop, power off) and one for requests that the run examines first.
"""

import asyncio
import hashlib
import logging
import threading
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from importlib import resources
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from rig import finite_json
from rig.page.access import COOKIE, VIEWER, Access, RateLimit
from rig.page.buckets import COARSER, Extremes, merged
from rig.page.checklist import BY_HAND, note
from rig.page.subject import Subject
from rig.people.request_client import RequestClient, RequestError

_LOG = logging.getLogger("uvicorn.error")
MAX_BROWSERS = 200
QUEUE = 100  # messages of a browser that wait: some eight seconds
POLL_S = 0.1
STATE_POLLS = 2  # polls from state to state
MAX_BUCKETS = 40  # in one message
MAX_FIELDS = 24  # that a browser may choose
MAX_MESSAGES_PER_S = 20  # of a browser
MAX_MESSAGE = 16_384  # characters
CONFIRM_ITEM, CHECK_HOST = "confirm_item", "check_host"  # requests to the page itself
URGENT = ("beat", "stop", "abort", "take_seat", "leave_seat")
_FILES = {
    "index.html": "text/html; charset=utf-8",
    "page.css": "text/css",
    **{
        f"{name}.js": "text/javascript"
        for name in ("page", "dom", "cards", "checklist", "manual", "rows", "surface", "traces")
    },
    "uPlot.iife.min.js": "text/javascript",
    "uPlot.min.css": "text/css",
    "uPlot.LICENSE": "text/plain",
    "icon.svg": "image/svg+xml",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Guard:
    """Refuses requests under another name, and adds the headers of every answer."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        problem = self._access.host_problem(headers)
        if not problem and (scope["type"] == "websocket" or scope["method"] == "POST"):
            problem = self._access.origin_problem(headers)
        if problem and scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": problem})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        app = PlainTextResponse(problem, 403) if problem else self._app
        await app(scope, receive, send_with_headers)


class Browser:
    """One connected browser."""

    def __init__(self, socket: WebSocket, role: str, first: tuple[str, ...]) -> None:
        self.socket, self.role = socket, role
        self.queue: asyncio.Queue[str] = asyncio.Queue(QUEUE)
        self.fields = first
        self.session = self.person = ""
        self.clients: dict[bool, RequestClient] = {}  # by urgency
        self.connecting = threading.Lock()
        self.dropped = asyncio.Event()
        self.rate = RateLimit(MAX_MESSAGES_PER_S, 1.0)

    def put(self, message: str) -> None:
        """Queue a message; a browser whose queue is full is dropped."""
        try:
            self.queue.put_nowait(message)
        except asyncio.QueueFull:
            self.dropped.set()


class Page:
    """The page of one run; `app` is its ASGI application."""

    def __init__(self, subject: Subject, access: Access) -> None:
        self._subject, self._access = subject, access
        self.browsers: set[Browser] = set()
        self._contents: dict[str, Any] = {}
        self._state = ""  # the newest, as it was sent
        self._urgent = ThreadPoolExecutor(8, "urgent")
        self._others = ThreadPoolExecutor(4, "requests")
        routes = [
            Route("/", self._static),
            Route("/login", self._login, methods=["POST"]),
            Route("/products/{name}", self._product),
            WebSocketRoute("/socket", self._connect),
            Route("/{name}", self._static),
        ]
        self.app = Guard(Starlette(routes=routes, lifespan=self._lifespan), access)

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(self._watch())
        yield
        task.cancel()
        self._subject.close()
        for pool in (self._urgent, self._others):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _static(self, request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in _FILES:
            return PlainTextResponse("not found", 404)
        data = resources.files("rig.page").joinpath("static", name).read_bytes()
        return Response(data, media_type=_FILES[name])

    async def _product(self, request: Request) -> Response:
        if not self._role(request.cookies, request.client):
            return PlainTextResponse("a token is required", 401)
        found = self._subject.product(request.path_params["name"])
        if found is None:
            return PlainTextResponse("not found", 404)
        return Response(found[0], media_type=found[1])

    async def _login(self, request: Request) -> Response:
        token = (await request.body())[:200].decode(errors="replace").strip()
        role, seconds = self._access.login(token)
        if not role:
            return PlainTextResponse("the token is not valid, or expired", 401)
        response = PlainTextResponse(role)
        secure = request.headers.get("origin", "").startswith("https:")
        response.set_cookie(
            COOKIE, token, max_age=int(seconds), httponly=True, samesite="strict", secure=secure
        )
        return response

    def _role(self, cookies: Mapping[str, str], client: Any) -> str:
        return self._access.role(cookies, tuple(client) if client else None)

    # --- the run's side

    async def _watch(self) -> None:
        """Poll the run and send what is new to every browser, whatever one poll leads to."""
        polls = 0
        while True:
            try:
                await self._poll(polls)
            except Exception:  # noqa: BLE001  (the browsers see that nothing comes, and connect anew)
                _LOG.exception("the run could not be shown")
                for browser in self.browsers:
                    browser.dropped.set()
                await asyncio.sleep(1.0)
            polls += 1
            await asyncio.sleep(POLL_S)

    async def _poll(self, polls: int) -> None:
        subject = self._subject
        buckets = subject.watch.poll()
        if buckets is not None:
            self._send_traces(merged(buckets, MAX_BUCKETS))
        if polls % STATE_POLLS:
            return
        entries = subject.new_entries()
        if entries:
            self._send(finite_json.dumps({"type": "journal", "entries": entries}))
        self._send_contents()
        self._state = finite_json.dumps({"type": "state"} | subject.state())
        self._send(self._state)

    def _send_contents(self) -> None:
        """Send the contents anew if they changed: columns of set points come after a while."""
        found = self._subject.describe()
        if found != self._contents:
            self._contents = found
            self._send(finite_json.dumps({"type": "contents", "contents": found}))

    def _send(self, message: str) -> None:
        for browser in self.browsers:
            if browser.session:
                browser.put(message)

    def _send_traces(self, buckets: Extremes) -> None:
        """Send buckets; browsers with the same fields share one message."""
        messages: dict[tuple[str, ...], str] = {}
        for browser in self.browsers:
            if browser.session and browser.fields:
                if browser.fields not in messages:
                    at = self._subject.watch.field_indices(browser.fields)
                    values = buckets._replace(low=buckets.low[:, at], high=buckets.high[:, at])
                    traces = {"type": "traces"} | _traces(browser.fields, values)
                    messages[browser.fields] = finite_json.dumps(traces)
                browser.put(messages[browser.fields])

    # --- the browsers' side

    async def _connect(self, socket: WebSocket) -> None:
        role = self._role(socket.cookies, socket.client)
        await socket.accept()
        if not role or len(self.browsers) >= MAX_BROWSERS:
            await socket.close(4401 if not role else 4429)
            return
        groups = self._subject.describe()["traces"]
        browser = Browser(socket, role, tuple(f for each in groups for f in each["first"]))
        self.browsers.add(browser)
        tasks = [
            asyncio.create_task(each)
            for each in (self._receive(browser), self._transmit(browser), browser.dropped.wait())
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.browsers.discard(browser)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for client in browser.clients.values():
                client.close()
            with suppress(Exception):
                await asyncio.wait_for(socket.close(4408), 1.0)

    async def _transmit(self, browser: Browser) -> None:
        while True:
            await browser.socket.send_text(await browser.queue.get())

    async def _receive(self, browser: Browser) -> None:
        """Read the browser's messages; each request is carried out in a task of its own."""
        requests: set[asyncio.Task[None]] = set()
        try:
            while True:
                text = await browser.socket.receive_text()
                if len(text) > MAX_MESSAGE:
                    return
                message = finite_json.loads(text)
                if not isinstance(message, dict):
                    return
                name = message.get("ask")
                if name not in ("stop", "abort") and not browser.rate.allows():
                    reason = f"at most {MAX_MESSAGES_PER_S} messages a second"
                    self._answer(browser, message, {"accepted": False, "reason": reason})
                elif "hello" in message:
                    self._greet(browser, message["hello"])
                elif not browser.session:
                    return
                elif "fields" in message:
                    self._choose_fields(browser, message["fields"])
                elif "speed" in message:
                    self._set_speed(browser, message["speed"])
                elif isinstance(name, str):
                    task = asyncio.create_task(self._ask(browser, message))
                    requests.add(task)
                    task.add_done_callback(requests.discard)
        except (WebSocketDisconnect, ValueError, RuntimeError, KeyError):
            return
        finally:
            for task in requests:
                task.cancel()

    def _greet(self, browser: Browser, hello: Any) -> None:
        """Send all that a browser needs to begin with."""
        given = hello if isinstance(hello, dict) else {}
        secret = str(given.get("session", ""))[:128]
        # The public name of the session does not give away the secret that renews its seat.
        browser.session = f"page {hashlib.sha256(secret.encode()).hexdigest()[:16]}"
        browser.person = str(given.get("person", ""))[:24]
        address = browser.socket.client.host if browser.socket.client else ""
        if self._access.needs_token:
            browser.person = f"{browser.person} {address}".strip()
        viewer = browser.role == VIEWER
        welcome = {"type": "welcome", "session": browser.session, "viewer": viewer}
        browser.put(finite_json.dumps(welcome))
        browser.put(finite_json.dumps({"type": "contents", "contents": self._subject.describe()}))
        browser.put(
            finite_json.dumps({"type": "journal", "entries": self._subject.journal, "all": True})
        )
        self._put_history(browser)
        if self._state:
            browser.put(self._state)

    def _put_history(self, browser: Browser) -> None:
        watch = self._subject.watch
        buckets = watch.buckets
        found = buckets.history(watch.field_indices(browser.fields))
        levels = [
            _traces(browser.fields, level) | {"size": size}
            for size, level in zip((1, *COARSER), found, strict=True)
        ]
        history = {"type": "history", "fields": browser.fields, "levels": levels}
        browser.put(finite_json.dumps(history | {"bucket_s": buckets.span_s}))

    def _choose_fields(self, browser: Browser, fields: Any) -> None:
        if isinstance(fields, list) and len(fields) <= MAX_FIELDS:
            chosen = tuple(each for each in fields if isinstance(each, str))
            self._subject.watch.field_indices(chosen)  # KeyError ends the connection
            browser.fields = chosen
            self._put_history(browser)

    def _set_speed(self, browser: Browser, speed: Any) -> None:
        """Set the speed of a replay, or start it over."""
        replay = self._subject.speed
        if replay is None or browser.role == VIEWER or not isinstance(speed, int | float | str):
            return
        if speed == "restart":
            replay.restart()
            self._subject.watch.clear()
            for each in self.browsers:
                self._put_history(each)
        elif not isinstance(speed, str):
            replay.set_speed(float(speed))

    async def _ask(self, browser: Browser, message: dict[str, Any]) -> None:
        name, given = message["ask"], message.get("arguments", {})
        arguments = given if isinstance(given, dict) else {}
        urgent = name in URGENT
        pool = self._urgent if urgent else self._others
        loop = asyncio.get_running_loop()
        answer = await loop.run_in_executor(pool, self._request, browser, urgent, name, arguments)
        if name != "beat" or not answer.get("accepted"):
            self._answer(browser, message, answer)

    def _request(
        self, browser: Browser, urgent: bool, name: str, arguments: dict[str, Any]
    ) -> dict[str, Any]:
        """Send a request to the run and return its answer."""
        if not self._subject.live:
            return {"accepted": False, "reason": "this run is a recorded one"}
        try:
            if name in (CONFIRM_ITEM, CHECK_HOST, "arm"):
                return self._before_power(browser, name, arguments)
            return self._forward(browser, name, arguments)
        except (RequestError, TypeError) as error:
            broken = browser.clients.pop(urgent, None)
            if broken is not None:
                broken.close()
            return {"accepted": False, "reason": str(error)}

    def _forward(self, browser: Browser, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        client = self._client(browser, urgent=name in URGENT)
        return client.ask(name, viewer=browser.role == VIEWER, **arguments)

    def _before_power(
        self, browser: Browser, name: str, arguments: dict[str, Any]
    ) -> dict[str, Any]:
        """Carry out a request about the checklist, or arm the run if nothing on it is open."""
        subject = self._subject
        if name == CONFIRM_ITEM:
            key = arguments.get("item")
            if not isinstance(key, str) or key not in BY_HAND:
                return {"accepted": False, "reason": "no such item is confirmed by hand"}
            given = note(key, confirmed=arguments.get("confirmed") is True)
            answer = self._forward(browser, "annotate", given)
            return answer | ({"reason": given["text"]} if answer.get("accepted") else {})
        orders = self._client(browser, urgent=False).ask("state")
        if orders.get("operator_session") != browser.session:
            holder = orders.get("operator")
            why = f"{holder} is the operator" if holder else "take the operator's seat first"
            return {"accepted": False, "reason": why}
        items = subject.checklist_items(orders)
        if name == CHECK_HOST:
            if subject.watch.powered or orders.get("armed") or orders.get("arming"):
                return {"accepted": False, "reason": "only while the power is off and not armed"}
            why = subject.checklist.check_host(str(orders.get("operator", "")))
            return {"accepted": not why, "reason": why or "the host was checked"}
        if subject.checklist.checking:
            return {"accepted": False, "reason": "the checks of the host run: wait for their end"}
        waiting = [each.text for each in items if not each.done]
        if waiting and arguments.get("all_the_same") is not True:
            return {"accepted": False, "reason": f"open on the checklist: {'; '.join(waiting)}"}
        if not items:
            return self._forward(browser, "arm", {})  # the run says that it waits for nobody
        known = "; ".join(each.text for each in items if each.done)
        text = f"armed with the checklist complete: {known}"
        if waiting:
            text = f"ARMED ALL THE SAME; open on the checklist: {'; '.join(waiting)}; done: {known}"
        noted = self._forward(browser, "annotate", {"text": text})
        return self._forward(browser, "arm", {}) if noted.get("accepted") else noted

    def _client(self, browser: Browser, *, urgent: bool) -> RequestClient:
        with browser.connecting:
            if urgent not in browser.clients:
                browser.clients[urgent] = RequestClient(
                    self._subject.folder, browser.session, browser.person, "page"
                )
            return browser.clients[urgent]

    def _answer(self, browser: Browser, message: dict[str, Any], answer: Mapping[str, Any]) -> None:
        shown = {key: answer.get(key) for key in ("accepted", "reason", "facts")}
        reply = {"type": "answer", "ask": str(message.get("ask", "")), "id": message.get("id")}
        browser.put(finite_json.dumps(reply | shown))


def _traces(fields: tuple[str, ...], buckets: Extremes) -> dict[str, Any]:
    """Return buckets, whose columns are these fields, for browsers."""
    return {
        "fields": fields,
        "time": [round(each, 4) for each in buckets.time.tolist()],
        "low": [[_short(each) for each in column] for column in buckets.low.T.tolist()],
        "high": [[_short(each) for each in column] for column in buckets.high.T.tolist()],
    }


def _short(value: Any) -> float | None:
    """Return a number with five digits for JSON; None for NaN."""
    number = float(value)
    return float(f"{number:.5g}") if number - number == 0.0 else None
