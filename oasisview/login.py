"""Who a browser is: the token, the signed cookie that carries a name, and the brake on guessing."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from pipeline.errors import InputError

MIN_TOKEN_LENGTH = 8
MAX_NAME_LENGTH = 60
SESSION_SECONDS = 12 * 3600


def checked_token(token: str | None) -> str:
    """The given token, or a fresh one for None.

    Raises:
        InputError: the token is too short to withstand guessing, or not printable.
    """
    if token is None:
        return secrets.token_urlsafe(24)
    if len(token) < MIN_TOKEN_LENGTH or not token.isprintable():
        raise InputError(
            "the token is too easy to guess",
            f"give at least {MIN_TOKEN_LENGTH} printable characters, or none to have one made",
        )
    return token


def same_secret(given: str, expected: str) -> bool:
    """Compare without telling by the time taken how much of it was right."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), expected.encode("utf-8"))


def cleaned_name(name: str) -> str | None:
    """A person's name as it goes into the journal; None if nothing readable is left or it is too long."""
    cleaned = " ".join(name.split())
    return cleaned if 0 < len(cleaned) <= MAX_NAME_LENGTH and cleaned.isprintable() else None


class NameCookie:
    """Signs names into cookie values that this process alone accepts, for ``SESSION_SECONDS``.

    The key is drawn anew by every process: a cookie says nothing about the token, so a weak token cannot
    be guessed from it offline.
    """

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self._key = secrets.token_bytes(32)
        self._clock = clock

    def issue(self, name: str) -> str:
        """Cookie value for a name."""
        encoded = base64.urlsafe_b64encode(name.encode()).decode().rstrip("=")
        payload = f"{encoded}.{int(self._clock()) + SESSION_SECONDS}"
        return f"{payload}.{self._signature(payload)}"

    def read(self, value: str) -> str | None:
        """The name in a cookie value; None if it was forged, altered, or has run out."""
        payload, _, signature = value.rpartition(".")
        if not hmac.compare_digest(signature.encode("utf-8", "replace"), self._signature(payload).encode()):
            return None
        encoded, _, expires = payload.rpartition(".")
        try:
            if int(expires) < self._clock():
                return None
            return base64.urlsafe_b64decode(encoded + "=" * (-len(encoded) % 4)).decode()
        except (ValueError, binascii.Error):
            return None

    def _signature(self, payload: str) -> str:
        return hmac.new(self._key, payload.encode("utf-8", "replace"), hashlib.sha256).hexdigest()


class LoginThrottle:
    """After a few wrong tokens an address has to wait, twice as long after each further one."""

    FREE_ATTEMPTS = 5
    MAX_WAIT_S = 300.0
    MAX_ADDRESSES = 4096

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._failures: OrderedDict[str, tuple[int, float]] = OrderedDict()  # count, time of the last

    def wait_s(self, address: str) -> float:
        """Seconds until the address may try again; 0 = now."""
        with self._lock:
            count, last = self._failures.get(address, (0, 0.0))
        if count < self.FREE_ATTEMPTS:
            return 0.0
        pause = min(self.MAX_WAIT_S, 2.0 ** min(count - self.FREE_ATTEMPTS, 30))
        return max(0.0, last + pause - self._clock())

    def failed(self, address: str) -> None:
        """Count a wrong token."""
        with self._lock:
            count, _ = self._failures.pop(address, (0, 0.0))
            self._failures[address] = (count + 1, self._clock())
            while len(self._failures) > self.MAX_ADDRESSES:
                self._failures.popitem(last=False)

    def succeeded(self, address: str) -> None:
        """Forget the failures of an address."""
        with self._lock:
            self._failures.pop(address, None)
