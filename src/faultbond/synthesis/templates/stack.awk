# The deepest stack of each function that programs call, over the graphs of calls that gcc writes (-fcallgraph-info=su): what a
# function takes itself, and the most of those it calls. Fails where that has no bound: a call of itself, by a pointer, or of
# a function whose frame is not known.
function quoted(key,    found) {
    match($0, key ": \"[^\"]*\"")
    found = substr($0, RSTART, RLENGTH)
    gsub(key ": |\"", "", found)
    return found
}

function deepest(name,    k, below, most) {
    if (name in depth) {
        if (depth[name] < 0) fail(name " calls itself")
        return depth[name]
    }
    if (!(name in own)) {
        if (name == "__indirect_call") fail("a call by a pointer")
        outside[name] = 1
        return 0
    }
    depth[name] = -1
    most = 0
    for (k = 1; k <= n_calls[name]; k++) {
        below = deepest(callee[name, k])
        if (below > most) {
            most = below
            next_of[name] = callee[name, k]
        }
    }
    return depth[name] = own[name] + most
}

function fail(why) {
    print "no bound: " why
    failed = 1
}

/^node:/ {
    if (match($0, /[0-9]+ bytes \([a-z,]+\)/)) {
        bytes = substr($0, RSTART, RLENGTH) + 0
        name = quoted("title")
        own[name] = bytes
        if ($0 ~ /bytes \(dynamic\)/) fail(name " takes what it is asked for")
    }
}

/^edge:/ {
    name = quoted("sourcename")
    callee[name, ++n_calls[name]] = quoted("targetname")
}

END {
    for (name in own) {
        if (name !~ /^fb_/ && name != "main") continue
        bytes = deepest(name)
        printf("%7d bytes  %s\n", bytes, name) | "sort -rn"
        if (bytes > most_of_all) {
            most_of_all = bytes
            first = name
        }
    }
    close("sort -rn")
    path = first
    for (name = first; name in next_of; name = next_of[name]) {
        called = next_of[name]
        path = path " > " substr(called, index(called, ":") + 1)
    }
    print "at the most " most_of_all " bytes: " path
    print "beside these what functions of the C library take:"
    for (name in outside) print "  " name | "sort"
    close("sort")
    exit (failed + 0)
}
