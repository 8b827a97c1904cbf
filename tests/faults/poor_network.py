#!/usr/bin/env python3
"""A TCP connection over a poor network: 50 ms each way, and 5 % of the segments come only after a retransmission.

    poor_network.py LISTEN TARGET

TCP hides a lost segment from both ends but for the time: what follows it waits for the retransmission, 200 ms at least
(RFC 6298 says 1 s; Linux takes 200 ms). So a delay stands for the loss.
"""
import queue
import random
import socket
import sys
import threading
import time

DELAY_S, LOST, AGAIN_S, SEGMENT = 0.050, 0.05, 0.200, 1448


def address(text):
    host, port = text.rsplit(":", 1)
    return host, int(port)


def passes(source, target):
    waiting = queue.Queue(maxsize=4096)

    def send():
        while True:
            due, data = waiting.get()
            time.sleep(max(0.0, due - time.monotonic()))
            try:
                if not data:
                    target.shutdown(socket.SHUT_WR)
                    return
                target.sendall(data)
            except OSError:
                return

    threading.Thread(target=send, daemon=True).start()
    # A fixed seed: the same network every time.
    chance, earliest = random.Random(7), 0.0
    while True:
        try:
            data = source.recv(65536)
        except OSError:
            data = b""
        segments = -(-len(data) // SEGMENT)
        lost = any(chance.random() < LOST for _ in range(segments))
        due = time.monotonic() + DELAY_S + (AGAIN_S if lost else 0.0)
        # TCP keeps the order.
        earliest = max(earliest, due)
        waiting.put((earliest, data))
        if not data:
            return


def main():
    listener = socket.create_server(address(sys.argv[1]))
    while True:
        near, _ = listener.accept()
        try:
            far = socket.create_connection(address(sys.argv[2]), timeout=5)
        except OSError:
            near.close()
            continue
        far.settimeout(None)
        for one, other in ((near, far), (far, near)):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=passes, args=(one, other), daemon=True).start()


if __name__ == "__main__":
    main()
