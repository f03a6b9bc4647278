def _median(values, votes):
    """Weighted median, element by element: half of the votes are below it, half above. NaN counts as infinite."""
    count, total = len(values), sum(votes)
    values = [ca.if_else(value <= ca.inf, value, ca.inf) for value in values]
    votes = list(votes)
    for last in range(count - 1, 0, -1):
        for k in range(last):
            (a, b), (n, m) = values[k : k + 2], votes[k : k + 2]
            swap = b < a
            values[k : k + 2] = ca.if_else(swap, b, a), ca.if_else(swap, a, b)
            votes[k : k + 2] = ca.if_else(swap, m, n), ca.if_else(swap, n, m)
    below = [votes[0]]
    for vote in votes[1:]:
        below.append(below[-1] + vote)
    median = values[-1]
    for k in range(count - 2, -1, -1):
        middle = ca.if_else(2 * below[k] == total, 0.5 * (values[k] + values[k + 1]), median)
        median = ca.if_else(2 * below[k] > total, values[k], middle)
    return median
