"""Rate limits: a burst, then a steady rate, for each caller of its own."""

from gateway.authorization.caller import MAX_CALLERS, CallerLimits, RateLimit, TokenBucket

LIMIT = RateLimit(burst=3, per_s=2.0)


def test_a_burst_passes_and_then_the_steady_rate() -> None:
    bucket = TokenBucket(LIMIT)
    assert [bucket.take(0) for _ in range(4)] == [True, True, True, False]
    assert [bucket.take(round(k * 1e8)) for k in range(1, 21)].count(True) == 4  # 2 s at 2 per second
    assert [bucket.take(10**12) for _ in range(4)] == [True, True, True, False]


def test_a_clock_that_stands_gives_nothing() -> None:
    bucket = TokenBucket(LIMIT)
    assert sum(bucket.take(7) for _ in range(100)) == 3


def test_one_caller_cannot_use_up_the_requests_of_another() -> None:
    limits = CallerLimits(LIMIT)
    assert sum(limits.take("eve", 0) for _ in range(1000)) == 3
    assert limits.take("ann", 0)


def test_a_bounded_number_of_callers_is_remembered() -> None:
    limits = CallerLimits(LIMIT)
    for number in range(2 * MAX_CALLERS):
        limits.take(str(number), 0)
    assert sum(limits.take(str(2 * MAX_CALLERS - 1), 0) for _ in range(3)) == 2
    assert sum(limits.take("0", 0) for _ in range(4)) == 3
