# What cppcheck's addon finds, counted by rule beside check/misra.txt, which says of each rule what it is and why it is not
# followed. Fails where a rule is violated that is not there.
BEGIN { FS = "[ ]*[|][ ]*" }
FNR == NR { if ($0 !~ /^#/ && NF == 5) kind[$1] = $2; next }
/^misra-c2012-/ {
    split($0, word, " ")
    rule = substr(word[1], length("misra-c2012-") + 1)
    found[rule] = 1
    if (word[2] ~ /^(program\/|columns\.h|names\.h)/) program[rule]++
    else library[rule]++
}
END {
    order = "sort -t. -k1,1n -k2,2n"
    print "rule     kind      places: library, program"
    for (rule in found) {
        is_told = rule in kind
        if (!is_told) strange++
        row = "%-8s %-9s %7d %8d%s\n"
        told = is_told ? "" : "  not in check/misra.txt"
        printf(row, rule, is_told ? kind[rule] : "?", library[rule], program[rule], told) | order
    }
    close(order)
    if (strange) print "rules that are violated and not in check/misra.txt: " strange
    exit (strange > 0)
}
