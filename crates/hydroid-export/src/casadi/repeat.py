def _repeat(function, times, state, *arguments):
    """The state after calls of a function that replace it."""
    for _ in range(times):
        state = function(state, *arguments)
    return state
