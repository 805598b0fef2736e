"""The daemon: the only place with threads, sockets and clocks. Sampling, processing, recording and publishing each have one."""
