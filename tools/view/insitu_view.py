#!/usr/bin/env python3
"""insitu-view: watch a running simulation, and edit its scene, in a browser or a terminal.

It runs on a login node with access to the run's files, and serves only 127.0.0.1: new pictures of a Cinema database, the
statistics stored with it, the run's report (report.json in the database), and, with --scene, an editor for the scene.
It requires only Python's standard library. The simulation contains no server: the two programs communicate only through
files.

Access. Every user of the node can connect to its 127.0.0.1, and so can every page that is open in a browser there.
Therefore each address begins with a token of 128 random bits, the Host header must be that of this machine (which
prevents DNS rebinding), and writing is possible only from a page of this server. The database's own page, which was
written by the run, is served with a separate origin: it can only show pictures.

Files. Only regular files with known extensions in the database are served. They are opened folder by folder without
following links. In addition, the numbers in statistics files and the scene are served. Folders are never listed.
"""

import argparse
import base64
import fcntl
import getpass
import hmac
import http.server
import json
import math
import os
import re
import secrets
import socket
import socketserver
import stat
import struct
import sys
import termios
import threading
import time
import urllib.parse

MAX_SCENE = 1 << 20  # in bytes; the same limit as in the library
MAX_REPORT = 1 << 20
MAX_STATISTICS, MAX_STATISTICS_FILES, MAX_ROWS = 8 << 20, 16, 1000
MAX_PICTURE = 64 << 20  # in bytes, for pictures that are sent to a terminal
MAX_CONNECTIONS = 64
TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".csv": "text/csv; charset=utf-8",
         ".json": "application/json", ".png": "image/png", ".exr": "image/x-exr"}
STATISTICS_COLUMNS = "cycle,time,cells,volume,minimum,maximum,mean,deviation"

PAGE = r"""@INSITU_VIEW_PAGE@"""


# ---- files ------------------------------------------------------------------------------------------------------------

def open_inside(root, parts):
    """Open a regular file in a folder tree for reading, without following links. Raises OSError if there is none."""
    if not parts or any(part in ("", ".", "..") or "/" in part or "\0" in part for part in parts):
        raise FileNotFoundError("no such file")
    folder = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        for name in parts[:-1]:
            below = os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
            os.close(folder)
            folder = below
        found = os.open(parts[-1], os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    finally:
        os.close(folder)
    file = os.fdopen(found, "rb")
    if not stat.S_ISREG(os.fstat(found).st_mode):
        file.close()
        raise FileNotFoundError("no regular file")
    return file


def read_inside(root, parts, limit):
    """Return the contents of a file, or None if it does not exist or has more than limit bytes."""
    try:
        with open_inside(root, parts) as file:
            data = file.read(limit + 1)
            return data if len(data) <= limit else None
    except OSError:
        return None


def stamp_of(info):
    """Return the modification time of a file in the format of report.json."""
    return "%d.%09d" % divmod(info.st_mtime_ns, 10**9)


class Changed(Exception):
    """Raised if the scene file has changed since it was read for editing."""


class Scene:
    """A scene file, or the target of the link if its name is a link."""

    def __init__(self, path):
        self.path, self.shown = os.path.realpath(path), path
        self.lock = threading.Lock()

    def read(self):
        """Return the text and its stamp. Raises OSError or ValueError if the file cannot be read."""
        with open(self.path, "rb") as file:
            info = os.fstat(file.fileno())
            data = file.read(MAX_SCENE + 1)
        if len(data) > MAX_SCENE:
            raise ValueError(f"has more than {MAX_SCENE} bytes")
        return data.decode("utf-8"), stamp_of(info)

    def stamp(self):
        try:
            return stamp_of(os.stat(self.path))
        except OSError:
            return None

    def write(self, text, stamp):
        """Replace the file atomically by the text, if the file still has this stamp. Returns the new stamp."""
        with self.lock:
            if self.stamp() != stamp:
                raise Changed()
            mode = stat.S_IMODE(os.stat(self.path).st_mode)
            new = f"{self.path}.{os.getpid()}.{secrets.token_hex(4)}"
            file = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            try:
                with os.fdopen(file, "wb") as out:
                    out.write(text.encode("utf-8"))
                    os.fchmod(out.fileno(), mode)
                    out.flush()
                    os.fsync(out.fileno())
                    info = os.fstat(out.fileno())
                os.rename(new, self.path)
            except BaseException:
                os.unlink(new)
                raise
            return stamp_of(info)


class Statistics:
    """The statistics files in the database's folder and in its parent folder."""

    def __init__(self, database):
        self.folders = (database, os.path.dirname(database))
        self.known = {}  # cache: (folder, name) -> (key of the file's state, table)

    def files(self):
        out = []
        for folder in self.folders:
            try:
                names = sorted(name for name in os.listdir(folder) if name.endswith(".csv"))
            except OSError:
                continue
            for name in names:
                if len(out) < MAX_STATISTICS_FILES:
                    table = self.table(folder, name)
                    out += [table] if table else []
        return out

    def table(self, folder, name):
        """Return the table of a file, or None if the file contains no statistics."""
        try:
            with open_inside(folder, [name]) as file:
                info = os.fstat(file.fileno())
                key = info.st_ino, info.st_mtime_ns, info.st_size
                known = self.known.get((folder, name))
                if not known or known[0] != key:
                    known = self.known[folder, name] = key, self.read(file, name, info.st_size)
                return known[1]
        except OSError:
            return None

    @staticmethod
    def read(file, name, size):
        header = file.readline(1 << 16).decode("utf-8", "replace").rstrip("\n")
        if not header.startswith(STATISTICS_COLUMNS):
            return None
        if size > MAX_STATISTICS:
            file.seek(size - MAX_STATISTICS)
            file.readline()
        lines = file.read(MAX_STATISTICS).decode("utf-8", "replace").split("\n")[:-1]  # drops an incomplete last line
        step = max(1, math.ceil(len(lines) / MAX_ROWS))
        chosen = lines[(len(lines) - 1) % step::step] if lines else []  # always includes the last line
        rows = []
        for line in chosen:
            try:
                row = [float(field) for field in line.split(",")[:8]]
            except ValueError:
                continue
            if len(row) == 8:
                rows.append([value if math.isfinite(value) else None for value in row])
        return {"name": name, "columns": STATISTICS_COLUMNS.split(","), "rows": rows, "lines": len(lines)}


# ---- the server --------------------------------------------------------------------------------------------------------

class Refused(Exception):
    def __init__(self, status, words):
        super().__init__(words)
        self.status = status


class View:
    """The database and scene that the server shows."""

    def __init__(self, database, scene):
        self.database, self.token = os.path.realpath(database), secrets.token_urlsafe(16)
        self.shown, self.scene, self.name = database, scene, os.path.basename(self.database)
        self.statistics, self.lock = Statistics(self.database), threading.Lock()

    def report(self):
        data = read_inside(self.database, ["report.json"], MAX_REPORT)
        try:
            report = json.loads(data.decode("utf-8", "replace")) if data else None
        except ValueError:
            return None
        return report if isinstance(report, dict) else None

    def state(self):
        with self.lock:
            tables = self.statistics.files()
        state = {"database": self.shown, "name": self.name, "report": self.report(), "statistics": tables,
                 "has_page": os.path.isfile(os.path.join(self.database, "index.html"))}
        if self.scene:
            state["scene"] = {"path": self.scene.shown, "stamp": self.scene.stamp()}
        return state


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version, timeout = "HTTP/1.1", 30
    server_version, sys_version = "insitu-view", ""

    def log_message(self, *_):
        """Log nothing, because addresses contain the token."""

    # -- access control and dispatch

    def parts(self):
        """Return the path behind the token. Raises Refused if the token or the Host header is wrong."""
        host = self.headers.get_all("Host", [])
        if len(host) != 1 or not re.fullmatch(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", host[0], re.IGNORECASE):
            raise Refused(403, "this server is 127.0.0.1 alone")
        parts = self.path.split("?", 1)[0].split("/")
        token = urllib.parse.unquote(parts[1]) if len(parts) > 1 and not parts[0] else ""
        if not hmac.compare_digest(token.encode("utf-8", "replace"), self.server.view.token.encode()):
            raise Refused(403, "the address is to be as insitu-view printed it")
        return [os.fsdecode(urllib.parse.unquote_to_bytes(part)) for part in parts[2:]]

    def do_GET(self):
        self.answer(self.get)

    do_HEAD = do_GET

    def do_POST(self):
        self.answer(self.post)

    def answer(self, method):
        try:
            method(self.parts())
        except Refused as refused:
            self.close_connection = True  # the request's body may be unread
            self.send_json({"error": str(refused)}, refused.status)
        except OSError:
            self.close_connection = True  # the client has disconnected

    def get(self, parts):
        view = self.server.view
        if parts == [""]:
            self.send_page()
        elif parts == ["state"]:
            self.send_json(view.state())
        elif parts == ["scene"] and view.scene:
            try:
                text, stamp = view.scene.read()
            except (OSError, ValueError) as error:
                raise Refused(500, f"{view.scene.shown} cannot be read: {getattr(error, 'strerror', None) or error}")
            self.send_json({"text": text, "stamp": stamp})
        elif parts[:2] == ["db", view.name]:
            self.send_file(view.database, parts[2:])
        else:
            raise Refused(404, "there is no such thing here")

    def post(self, parts):
        scene = self.server.view.scene
        origin = self.headers.get_all("Origin", [])
        if origin and origin != ["http://" + self.headers["Host"]]:
            raise Refused(403, "a page from elsewhere may change nothing here")
        if parts != ["scene"] or not scene:
            raise Refused(404, "there is no such thing here")
        body = self.body()
        try:
            stamp = scene.write(body["text"], body["stamp"])
        except Changed:
            raise Refused(409, "the file was changed by another program since it was read here")
        except OSError as error:
            raise Refused(500, f"{scene.shown} cannot be saved: {error.strerror}")
        self.send_json({"stamp": stamp})

    def body(self):
        """Return the posted mapping, which must contain two strings."""
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Transfer-Encoding") or not re.fullmatch(r"\d{1,9}", length):
            raise Refused(411, "expected a Content-Length")
        if int(length) > 6 * MAX_SCENE:  # JSON may encode a byte as six
            raise Refused(413, f"expected at most {MAX_SCENE} bytes")
        if self.headers.get_content_type() != "application/json":
            raise Refused(415, "expected application/json")
        try:
            body = json.loads(self.rfile.read(int(length)).decode("utf-8"))
            sizes = [len(body[key].encode("utf-8")) for key in ("text", "stamp")]
        except (ValueError, KeyError, TypeError, AttributeError):
            raise Refused(400, "expected a mapping with the texts text and stamp")
        if sizes[0] > MAX_SCENE:
            raise Refused(413, f"expected at most {MAX_SCENE} bytes")
        return body

    # -- responses

    def send_head(self, status, kind, size, **others):
        self.send_response(status)
        headers = {"Content-Type": kind, "Content-Length": str(size), "Cache-Control": "no-cache",
                   "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
                   "Cross-Origin-Opener-Policy": "same-origin"}
        for name, value in others.items():
            headers[name.replace("_", "-")] = value
        for name, value in headers.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()

    def send_bytes(self, data, kind, status=200, **others):
        self.send_head(status, kind, len(data), **others)
        if self.command != "HEAD":
            self.wfile.write(data)

    def send_json(self, what, status=200):
        self.send_bytes(json.dumps(what).encode("utf-8"), "application/json", status, Cache_Control="no-store")

    def send_page(self):
        nonce = secrets.token_urlsafe(16)
        rule = (f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src data:; "
                "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
        page = PAGE.replace("NONCE", nonce).encode("utf-8")
        self.send_bytes(page, TYPES[".html"], Cache_Control="no-store", Content_Security_Policy=rule)

    def send_file(self, root, parts):
        kind = TYPES.get(os.path.splitext(parts[-1])[1].lower()) if parts else None
        try:
            file = open_inside(root, parts) if kind else None
        except (OSError, ValueError):
            file = None
        if not file:
            raise Refused(404, "there is no such file in the database")
        with file:
            info = os.fstat(file.fileno())
            others = {"ETag": f'"{info.st_ino:x}-{info.st_mtime_ns:x}-{info.st_size:x}"',
                      "Last_Modified": self.date_time_string(int(info.st_mtime)),
                      # A separate origin, which may read tables but write nothing.
                      "Access_Control_Allow_Origin": "null", "Access_Control_Expose_Headers": "Content-Length",
                      "Content_Security_Policy": "sandbox allow-scripts allow-forms"}
            if self.headers.get("If-None-Match") == others["ETag"]:
                self.send_head(304, kind, info.st_size, **others)
                return
            self.send_head(200, kind, info.st_size, **others)
            left = info.st_size if self.command != "HEAD" else 0
            while left > 0:
                piece = file.read(min(left, 1 << 20))
                if not piece:
                    self.close_connection = True  # the file was truncated in the meantime
                    break
                self.wfile.write(piece)
                left -= len(piece)


class Server(socketserver.ThreadingMixIn, http.server.HTTPServer):
    daemon_threads, allow_reuse_address, request_queue_size = True, False, 16

    def __init__(self, port, view):
        super().__init__(("127.0.0.1", port), Handler)
        self.view, self.places = view, threading.BoundedSemaphore(MAX_CONNECTIONS)

    def server_bind(self):
        """Bind the socket as HTTPServer does, but without a DNS lookup of the machine's name."""
        socketserver.TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address

    def process_request(self, request, client_address):
        if self.places.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request, client_address):
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.places.release()

    def handle_error(self, request, client_address):
        """Report errors except for closed connections."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


def serve(options, view):
    try:
        server = Server(options.port, view)
    except OSError as error:
        sys.exit(f"insitu-view: port {options.port}: {error.strerror}")
    port = server.server_port
    print(f"Open {options.database} at\n  http://127.0.0.1:{port}/{view.token}/\n"
          f"From another machine, first\n  ssh -L {port}:127.0.0.1:{port} {getpass.getuser()}@{socket.gethostname()}\n"
          "Who has this address sees the pictures" + (" and can edit the scene" if view.scene else "") + ". Ctrl-C ends.",
          flush=True)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        print()


# ---- the terminal ------------------------------------------------------------------------------------------------------

def newest_picture(database):
    """Return the name of the last PNG in the database's table, or None if there is none yet."""
    try:
        with open_inside(database, ["data.csv"]) as file:
            size = os.fstat(file.fileno()).st_size
            file.seek(max(0, size - (1 << 16)))
            lines = file.read(1 << 16).decode("utf-8", "surrogateescape").split("\n")[:-1]
    except OSError:
        return None
    for line in reversed(lines):
        match = re.search(r'(?:^|,)(?:"((?:[^"]|"")*)"|([^",]*))$', line)
        name = match and (match.group(1).replace('""', '"') if match.group(1) is not None else match.group(2))
        if name and name.lower().endswith(".png"):
            return name
    return None


def choose_protocol(environment):
    """Return the terminal's protocol for pictures, or None if it is not known to support any."""
    program, kind = environment.get("TERM_PROGRAM", ""), environment.get("TERM", "")
    if "kitty" in kind or "ghostty" in kind or program.lower() == "ghostty" or "KITTY_WINDOW_ID" in environment:
        return "kitty"
    if program in ("iTerm.app", "WezTerm", "mintty", "vscode") or environment.get("LC_TERMINAL") == "iTerm2":
        return "iterm2"
    return None


def columns_for(data):
    """Return the number of columns to which a PNG must be shrunk; 0 if it fits or the terminal's width is unknown."""
    try:
        answer = fcntl.ioctl(sys.stdout.fileno(), termios.TIOCGWINSZ, bytes(8))
    except OSError:
        return 0
    _, columns, width, _ = struct.unpack("HHHH", answer)
    return columns if len(data) >= 24 and 0 < width < struct.unpack(">I", data[16:20])[0] else 0


def picture_codes(protocol, data, columns):
    """Return the escape sequence with which a terminal shows a PNG.
    https://sw.kovidgoyal.net/kitty/graphics-protocol/, https://iterm2.com/documentation-images.html"""
    text = base64.standard_b64encode(data)
    if protocol == "iterm2":
        return b"\x1b]1337;File=inline=1;size=%d;width=auto:%s\x07\n" % (len(data), text)
    out, pieces = b"", [text[i:i + 4096] for i in range(0, len(text), 4096)]
    for i, piece in enumerate(pieces):
        keys = b"a=T,f=100,q=2," + (b"c=%d," % columns if columns else b"") if i == 0 else b""
        out += b"\x1b_G%sm=%d;%s\x1b\\" % (keys, i < len(pieces) - 1, piece)
    return out + b"\n"


def show_in_terminal(options):
    protocol = options.protocol or choose_protocol(os.environ)
    if not protocol:
        sys.exit("insitu-view: this terminal is not known to show pictures (TERM is "
                 f"{os.environ.get('TERM', 'not set')}); if it does, say how: --protocol kitty or --protocol iterm2")
    database, shown = os.path.realpath(options.database), None
    try:
        while True:
            name = newest_picture(database)
            data = read_inside(database, name.split("/"), MAX_PICTURE) if name else None
            if data and (name, hash(data)) != shown:
                shown = name, hash(data)
                sys.stdout.buffer.write(ascii(name)[1:-1].encode() + b"\n" + picture_codes(protocol, data, columns_for(data)))
                sys.stdout.buffer.flush()
            time.sleep(1)
    except (KeyboardInterrupt, BrokenPipeError):
        pass


# ---- the command -------------------------------------------------------------------------------------------------------

def parse_options():
    parser = argparse.ArgumentParser(prog="insitu-view", description="Watch the pictures of a running simulation in a "
                                     "browser or a terminal, and edit its scene.")
    parser.add_argument("database", metavar="DATABASE", help="the folder of a Cinema database, as the scene names it "
                        "(outputs: [{cinema: run.cdb}]); it may come later")
    parser.add_argument("--scene", metavar="FILE", help="the run's scene file, to be edited in the browser")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="the port, instead of a free one")
    parser.add_argument("--terminal", action="store_true", help="show the newest picture in this terminal, whenever "
                        "there is one, instead of serving a browser")
    parser.add_argument("--protocol", choices=["kitty", "iterm2"], help="how the terminal takes pictures, instead of "
                        "by TERM and TERM_PROGRAM")
    options = parser.parse_args()
    if os.path.exists(options.database) and not os.path.isdir(options.database):
        parser.error(f"{options.database} is no folder, expected that of a Cinema database")
    if not 0 <= options.port <= 65535:
        parser.error(f"--port: is {options.port}, expected 0 to 65535")
    if options.terminal and (options.scene or options.port):
        parser.error("--terminal shows pictures alone, expected it without --scene and --port")
    if options.protocol and not options.terminal:
        parser.error("--protocol is of --terminal, which is not given")
    return options, parser


def main():
    options, parser = parse_options()
    if options.terminal:
        show_in_terminal(options)
        return
    scene = Scene(options.scene) if options.scene is not None else None
    try:
        if scene:
            scene.read()
    except (OSError, ValueError) as error:
        parser.error(f"{options.scene} cannot be read: {getattr(error, 'strerror', None) or error}")
    serve(options, View(options.database, scene))


if __name__ == "__main__":
    main()
