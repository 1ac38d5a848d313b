"""insitu-view as tests start it."""
import re
import subprocess
import sys
import urllib.parse


class View:
    """A running insitu-view: its address, in parts. It ends with the `with` block."""

    def __init__(self, program, *arguments, folder):
        self.process = subprocess.Popen([sys.executable, program, *arguments], cwd=folder, stdout=subprocess.PIPE, text=True)
        lines = [self.process.stdout.readline() for _ in range(5)]
        self.printed = "".join(lines)
        self.address = re.search(r"http://\S+", self.printed).group()
        self.port, self.root = urllib.parse.urlsplit(self.address).port, urllib.parse.urlsplit(self.address).path

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(10)
        self.process.stdout.close()
